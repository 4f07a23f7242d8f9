# SPDX-License-Identifier: MIT
# cmake --install, and packages by cpack. All paths are relative to where the package is put: it may move.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(config_dir ${CMAKE_INSTALL_DATADIR}/cmake/talus) # nothing in it depends on the machine
install(DIRECTORY include/talus DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(TARGETS talus EXPORT talusTargets)
install(EXPORT talusTargets NAMESPACE talus:: DESTINATION ${config_dir})

configure_package_config_file(cmake/talusConfig.cmake.in ${PROJECT_BINARY_DIR}/talusConfig.cmake
                              INSTALL_DESTINATION ${config_dir})
# Before 1.0 a minor version may break the interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/talusConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion ARCH_INDEPENDENT)
configure_file(cmake/talus.pc.in ${PROJECT_BINARY_DIR}/talus.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/talusConfig.cmake ${PROJECT_BINARY_DIR}/talusConfigVersion.cmake
              cmake/build_type.cmake DESTINATION ${config_dir})
install(FILES ${PROJECT_BINARY_DIR}/talus.pc DESTINATION ${CMAKE_INSTALL_DATADIR}/pkgconfig)
install(FILES LICENSE README.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR})

set(CPACK_GENERATOR "TGZ;DEB")
set(CPACK_PACKAGE_NAME talus)
set(CPACK_DEBIAN_PACKAGE_NAME libtalus-dev)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_PACKAGE_FILE_NAME talus-${PROJECT_VERSION})
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
set(CPACK_PACKAGE_CONTACT "the talus developers <talus@localhost>")
set(CPACK_PACKAGE_VENDOR talus)
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "libeigen3-dev (>= 3.4)")
include(CPack)
