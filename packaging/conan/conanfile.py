# SPDX-License-Identifier: MIT
"""Conan 2 recipe for the checkout that it lies in: conan create packaging/conan --build=missing"""
import re
from pathlib import Path

from conan import ConanFile
from conan.tools.build import check_min_cppstd
from conan.tools.files import copy, load


class TalusRecipe(ConanFile):
    name = "talus"
    description = "Granular flows as a Drucker-Prager continuum, header-only"
    license = "MIT"
    topics = ("granular", "material-point-method", "continuum", "header-only")
    package_type = "header-library"
    settings = "os", "arch", "compiler", "build_type"
    no_copy_source = True

    def _checkout(self):
        return str(Path(self.recipe_folder).parent.parent)

    def set_version(self):
        header = load(self, str(Path(self._checkout(), "include", "talus", "version.hpp")))
        self.version = re.search(r'TALUS_VERSION "([^"]+)"', header).group(1)

    def export_sources(self):
        for pattern in ("include/*", "LICENSE"):
            copy(self, pattern, src=self._checkout(), dst=self.export_sources_folder)

    def requirements(self):
        self.requires("eigen/[>=3.4 <4]", transitive_headers=True)

    def validate(self):
        if self.settings.get_safe("compiler.cppstd"):
            check_min_cppstd(self, 20)

    def package(self):
        for pattern, folder in (("include/*", ""), ("LICENSE", "licenses")):
            copy(self, pattern, src=self.source_folder, dst=str(Path(self.package_folder, folder)))

    def package_id(self):
        self.info.clear()  # headers: one package for all settings

    def package_info(self):
        self.cpp_info.bindirs = []
        self.cpp_info.libdirs = []
        if self.settings.get_safe("os") == "Linux":
            self.cpp_info.system_libs = ["pthread"]
        self.cpp_info.set_property("cmake_file_name", "talus")
        self.cpp_info.set_property("cmake_target_name", "talus::talus")
        self.cpp_info.set_property("pkg_config_name", "talus")
