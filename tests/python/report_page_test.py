# SPDX-License-Identifier: MIT
"""report.html of a rendered drive in Chromium: it draws without a network, hover, wheel and keyboard work."""

import json
import os
import pathlib
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = os.environ.get("STEMVO_PROGRAM", str(ROOT / "build/release/stemvo"))
BROWSER = ROOT / "build/venv-browser/bin/python"
FRAMES = 30


@unittest.skipUnless(BROWSER.exists() and pathlib.Path("/usr/bin/chromium").exists(), "tools/setup.sh browser has not run")
class ReportPage(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        drive, out = pathlib.Path(folder.name) / "drive", pathlib.Path(folder.name) / "result"
        subprocess.run([PROGRAM, "synth", drive, "--frames", str(FRAMES), "--width", "620", "--height", "188"], check=True, capture_output=True)
        subprocess.run([PROGRAM, "run", drive / "sequences/00", "--out", out, "--quiet"], check=True, capture_output=True)
        look = subprocess.run([BROWSER, ROOT / "tests/browser/look_at_report.py", out / "report.html"], capture_output=True, text=True, check=False)
        if look.returncode != 0:
            raise AssertionError(look.stderr)
        cls.found = json.loads(look.stdout)

    def test_draws_everything_without_errors_or_a_network(self):
        self.assertEqual(self.found["errors"], [])
        self.assertEqual([url for url in self.found["requests"] if not url.startswith(("file:", "data:", "blob:"))], [])
        self.assertIn(f"frames 0:{FRAMES} of 00", self.found["title"])
        self.assertEqual(self.found["figures"], 7)
        self.assertEqual(len(self.found["images"]), 6)
        self.assertTrue(all(width > 100 for width in self.found["images"]))
        for heading in ("Path from above", "Numbers", "Error by segment length", "Scale and camera", "Command", "Configuration"):
            self.assertIn(heading, self.found["headings"])

    def test_keyboard_hover_and_wheel(self):
        self.assertTrue(self.found["by_keyboard"].startswith("frame 2: "), self.found["by_keyboard"])
        self.assertRegex(self.found["hover"], f"frame {FRAMES // 2}: [a-z_]+, .* m off")
        self.assertIn(self.found["hover"], self.found["by_hover"])
        (left, right), (zoomed_left, zoomed_right) = self.found["zoom"]
        self.assertLess(zoomed_right - zoomed_left, 0.9 * (right - left))

    def test_dark_and_narrow(self):
        self.assertNotEqual(self.found["light"], self.found["dark"])
        self.assertLessEqual(self.found["phone_width"], 380)


if __name__ == "__main__":
    unittest.main()
