# SPDX-License-Identifier: MIT
# talus::openmp is talus::talus with OpenMP's flags; talus::talus itself never has them. Called where
# a user asked for it: in the build tree by TALUS_WITH_OPENMP, installed by COMPONENTS OpenMP.
function(talus_add_openmp_target)
  if(TARGET talus::openmp)
    return()
  endif()
  if(NOT TARGET OpenMP::OpenMP_CXX)
    find_package(OpenMP QUIET COMPONENTS CXX)
    if(NOT OpenMP_CXX_FOUND)
      return()
    endif()
    # seen where talus::openmp is used, not only in this folder
    set_target_properties(OpenMP::OpenMP_CXX PROPERTIES IMPORTED_GLOBAL TRUE)
  endif()
  add_library(talus::openmp INTERFACE IMPORTED GLOBAL)
  set_target_properties(talus::openmp PROPERTIES INTERFACE_LINK_LIBRARIES "talus::talus;OpenMP::OpenMP_CXX")
endfunction()
