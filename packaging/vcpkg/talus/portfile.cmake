# SPDX-License-Identifier: MIT
# An overlay port for the checkout that it lies in: vcpkg install talus --overlay-ports=TALUS/packaging/vcpkg
get_filename_component(SOURCE_PATH "${CURRENT_PORT_DIR}/../../.." ABSOLUTE)

vcpkg_cmake_configure(
  SOURCE_PATH "${SOURCE_PATH}"
  OPTIONS -DTALUS_BUILD_TESTS=OFF -DTALUS_BUILD_EXAMPLES=OFF -DTALUS_INSTALL=ON)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(CONFIG_PATH share/cmake/talus)
vcpkg_fixup_pkgconfig()
# headers only: nothing differs in a debug build, and the licence goes where vcpkg wants it
file(REMOVE_RECURSE "${CURRENT_PACKAGES_DIR}/debug" "${CURRENT_PACKAGES_DIR}/share/doc"
     "${CURRENT_PACKAGES_DIR}/share/cmake")
vcpkg_install_copyright(FILE_LIST "${SOURCE_PATH}/LICENSE")
