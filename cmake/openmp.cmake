# SPDX-License-Identifier: MIT
# The opt-in target talus::openmp, in the build tree and for those who find_package(talus).
# Looks for OpenMP only when it was found already or is asked for, so that talus alone needs none.
function(talus_add_openmp_target)
  if(TARGET talus::openmp)
    return()
  endif()
  find_package(OpenMP QUIET COMPONENTS CXX)
  if(OpenMP_CXX_FOUND)
    add_library(talus_openmp INTERFACE IMPORTED GLOBAL)
    set_target_properties(talus_openmp PROPERTIES INTERFACE_LINK_LIBRARIES "talus::talus;OpenMP::OpenMP_CXX")
    add_library(talus::openmp ALIAS talus_openmp)
  endif()
endfunction()
