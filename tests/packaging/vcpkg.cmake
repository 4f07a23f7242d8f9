# SPDX-License-Identifier: MIT
# Runs the vcpkg port without vcpkg: cmake -DOUT=FOLDER -P tests/packaging/vcpkg.cmake
# The functions below do what vcpkg's of the same name do to a header-only package.
get_filename_component(root ${CMAKE_CURRENT_LIST_DIR}/../.. ABSOLUTE)
set(CURRENT_PORT_DIR ${root}/packaging/vcpkg/talus)
set(CURRENT_PACKAGES_DIR ${OUT}/package)
file(REMOVE_RECURSE ${OUT})

function(vcpkg_cmake_configure)
  cmake_parse_arguments(arg "" "SOURCE_PATH" "OPTIONS" ${ARGN})
  execute_process(COMMAND ${CMAKE_COMMAND} -S ${arg_SOURCE_PATH} -B ${OUT}/build ${arg_OPTIONS}
                          -DCMAKE_INSTALL_PREFIX=${CURRENT_PACKAGES_DIR}
                  OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
endfunction()
function(vcpkg_cmake_install)
  execute_process(COMMAND ${CMAKE_COMMAND} --install ${OUT}/build OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
endfunction()
function(vcpkg_cmake_config_fixup) # to share/PORT, which is a folder higher up
  cmake_parse_arguments(arg "" "CONFIG_PATH" "" ${ARGN})
  file(RENAME ${CURRENT_PACKAGES_DIR}/${arg_CONFIG_PATH} ${CURRENT_PACKAGES_DIR}/share/talus)
  file(GLOB files ${CURRENT_PACKAGES_DIR}/share/talus/*.cmake)
  foreach(file IN LISTS files)
    file(READ ${file} text)
    string(REPLACE "/../../../" "/../../" text "${text}")
    string(REGEX REPLACE "(get_filename_component\\(_IMPORT_PREFIX \"\\\${_IMPORT_PREFIX}\" PATH\\)\n)(get_filename_component\\(_IMPORT_PREFIX)" "\\2" text "${text}")
    file(WRITE ${file} "${text}")
  endforeach()
endfunction()
function(vcpkg_fixup_pkgconfig)
endfunction()
function(vcpkg_install_copyright)
  cmake_parse_arguments(arg "" "" "FILE_LIST" ${ARGN})
  file(COPY_FILE ${arg_FILE_LIST} ${CURRENT_PACKAGES_DIR}/share/talus/copyright)
endfunction()

include(${CURRENT_PORT_DIR}/portfile.cmake)
foreach(file include/talus/talus.hpp share/talus/talusConfig.cmake share/talus/copyright share/pkgconfig/talus.pc)
  if(NOT EXISTS ${CURRENT_PACKAGES_DIR}/${file})
    message(FATAL_ERROR "the vcpkg port lacks ${file}")
  endif()
endforeach()
file(READ ${CURRENT_PORT_DIR}/vcpkg.json manifest)
string(JSON version GET "${manifest}" version-semver)
file(READ ${CURRENT_PACKAGES_DIR}/include/talus/version.hpp header)
if(NOT header MATCHES "TALUS_VERSION \"${version}\"")
  message(FATAL_ERROR "vcpkg.json is of version ${version}, version.hpp of another")
endif()
execute_process(COMMAND ${CMAKE_COMMAND} -S ${root}/tests/consumer/find_package -B ${OUT}/consumer
                        -Dtalus_DIR=${CURRENT_PACKAGES_DIR}/share/talus
                OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
message(STATUS "ok  vcpkg port, its functions played by a script")
