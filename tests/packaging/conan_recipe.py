#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs the Conan recipe without Conan, whose calls are played by a few lines:

    python3 tests/packaging/conan_recipe.py FOLDER

Where Conan 2 is installed, use it instead: conan create packaging/conan --build=missing
"""
import fnmatch
import importlib.util
import shutil
import sys
import types
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def copy(_recipe, pattern, src, dst):
    """Like conan.tools.files.copy: a pattern is for the whole relative path, and * crosses folders."""
    for file in Path(src).rglob("*"):
        relative = file.relative_to(src)
        if file.is_file() and fnmatch.fnmatch(str(relative), pattern):
            target = Path(dst, relative)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, target)


def module(name, **contents):
    sys.modules[name] = types.ModuleType(name)
    vars(sys.modules[name]).update(contents)


module("conan", ConanFile=object)
module("conan.tools")
module("conan.tools.build", check_min_cppstd=lambda recipe, least: None)
module("conan.tools.files", copy=copy, load=lambda recipe, path: Path(path).read_text(encoding="utf-8"))

spec = importlib.util.spec_from_file_location("recipe", ROOT / "packaging/conan/conanfile.py")
loaded = importlib.util.module_from_spec(spec)
spec.loader.exec_module(loaded)

out = Path(sys.argv[1])
shutil.rmtree(out, ignore_errors=True)
recipe = loaded.TalusRecipe()
recipe.recipe_folder = str(ROOT / "packaging/conan")
recipe.export_sources_folder = recipe.source_folder = str(out / "sources")
recipe.package_folder = str(out / "package")
recipe.set_version()
recipe.export_sources()
recipe.package()

packed = {str(p.relative_to(out / "package")) for p in (out / "package").rglob("*") if p.is_file()}
headers = {str(p.relative_to(ROOT)) for p in (ROOT / "include").rglob("*.hpp")}
assert packed == headers | {"licenses/LICENSE"}, packed ^ (headers | {"licenses/LICENSE"})
assert f'TALUS_VERSION "{recipe.version}"' in (ROOT / "include/talus/version.hpp").read_text(encoding="utf-8")
print(f"ok  Conan recipe of talus {recipe.version}, Conan played by a script: {len(packed)} files")
