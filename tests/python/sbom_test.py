# SPDX-License-Identifier: MIT
"""The bill of materials of the program as it is built (SPDX 2.3 JSON)."""

import json
import os
import pathlib
import re
import subprocess
import sys
import unittest

import sbom

PROGRAM = os.environ["STEMVO_PROGRAM"]
TOOL = pathlib.Path(sbom.__file__)


class Bill(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        run = subprocess.run([sys.executable, TOOL, PROGRAM], check=True, capture_output=True, text=True)
        cls.bill = json.loads(run.stdout)
        cls.packages = {package["name"]: package for package in cls.bill["packages"]}

    def test_is_a_document_of_spdx_2_3(self):
        self.assertEqual(self.bill["spdxVersion"], "SPDX-2.3")
        self.assertEqual(self.bill["dataLicense"], "CC0-1.0")
        self.assertRegex(self.bill["creationInfo"]["created"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ$")
        ids = [package["SPDXID"] for package in self.bill["packages"]]
        self.assertEqual(len(ids), len(set(ids)))
        for one in ids:
            self.assertRegex(one, r"^SPDXRef-[A-Za-z0-9.-]+$")
        related = {relation["relatedSpdxElement"] for relation in self.bill["relationships"]}
        self.assertEqual(related, set(ids))

    def test_lists_every_library_that_is_linked(self):
        needed = re.findall(r"\[(lib\S+\.so\S*)\]", sbom.output_of("readelf", "--dynamic", "--wide", PROGRAM))
        self.assertGreater(len(needed), 10)
        for library, file in sbom.linked_libraries(PROGRAM).items():
            if not library.startswith("ld-linux"):
                name = "onnxruntime" if library.startswith("libonnxruntime.") else sbom.package_of(file)
                self.assertIn(name, self.packages, library)

    def test_names_what_the_program_is_made_of(self):
        for wanted in ("libopencv-core", "libopencv-videoio", "libyaml-cpp", "libfmt", "libdeflate", "libssl|libcrypto",
                       "libturbojpeg", "libpng", "libcereal-dev", "libeigen3-dev", "nlohmann-json3-dev", "libcli11-dev", "stemvo"):  # fmt: skip
            self.assertTrue(any(re.match(wanted, name) for name in self.packages), wanted)
        for package in self.packages.values():
            self.assertTrue(package["versionInfo"], package["name"])
            self.assertNotEqual(package["licenseDeclared"], "NOASSERTION", package["name"])

    def test_downloads_have_the_version_and_the_hash_that_are_pinned(self):
        setup = (TOOL.parent / "setup.sh").read_text()
        for name in ("onnxruntime", "plotly"):
            package = self.packages[name]
            self.assertIn(f"version={package['versionInfo']}", setup)
            self.assertIn(package["checksums"][0]["checksumValue"], setup)
            self.assertEqual(package["licenseDeclared"], "MIT")


if __name__ == "__main__":
    unittest.main()
