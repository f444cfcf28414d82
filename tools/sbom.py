#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""sbom.py [PROGRAM]: the bill of materials of a built program as SPDX 2.3 JSON on stdout: the Debian packages of the
libraries it links and of those it is compiled from, and what tools/setup.sh downloads for it."""

import datetime
import hashlib
import json
import os
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
HEADERS_ONLY = ("libeigen3-dev", "nlohmann-json3-dev", "libcli11-dev", "libcereal-dev")
# Debian's short names of licences; what is not here is left open (NOASSERTION) and named in licenseComments.
LICENCES = {
    "apache-2.0": "Apache-2.0", "apache-2": "Apache-2.0", "expat": "MIT", "mit": "MIT", "mpl-2": "MPL-2.0",
    "mpl-2.0": "MPL-2.0", "bsd-2-clause": "BSD-2-Clause", "bsd-3-clause": "BSD-3-Clause", "zlib": "Zlib",
    "lgpl-2.1": "LGPL-2.1-only", "lgpl-2.1+": "LGPL-2.1-or-later", "gpl-3": "GPL-3.0-only",
}  # fmt: skip
# Where Debian's file is in no such form, or names more than the library is under: what it says in words.
DECLARED = {
    "libc6": "LGPL-2.1-or-later", "libcairo": "LGPL-2.1-only OR MPL-1.1", "libfmt": "MIT", "libyaml-cpp": "MIT",
    "libgcc-s": "GPL-3.0-or-later WITH GCC-exception-3.1", "libstdc++": "GPL-3.0-or-later WITH GCC-exception-3.1",
    "libpng16": "libpng-2.0", "libturbojpeg": "IJG AND BSD-3-Clause AND Zlib",
}  # fmt: skip
# As their own licence files beside them say.
DOWNLOADS = {"onnxruntime": "MIT", "plotly": "MIT"}


def output_of(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True, env={**os.environ, "LC_ALL": "C"}).stdout


def video_module(program):
    """Loaded by the program where a video is read: as it was built, or as it was installed."""
    folder = pathlib.Path(program).resolve().parent
    places = [folder / "libstemvo_video.so", *folder.parent.glob("lib/**/stemvo/libstemvo_video.so")]
    return next((place for place in places if place.exists()), None)


def linked_libraries(program):
    """Names the program and its module ask for themselves, with the files that the loader finds."""
    libraries = {}
    for binary in filter(None, (program, video_module(program))):
        needed = re.findall(r"\(NEEDED\).*\[(.+)\]", output_of("readelf", "--dynamic", "--wide", binary))
        found = dict(re.findall(r"^\s*(\S+) => (/\S+)", output_of("ldd", binary), re.MULTILINE))
        libraries |= {name: found.get(name) for name in needed}
    return libraries


def package_of(file):
    """The Debian package a file belongs to, or None. The list may name it without /usr."""
    for name in {str(file), os.path.realpath(file), str(file).removeprefix("/usr")}:
        search = subprocess.run(["dpkg-query", "--search", name], capture_output=True, text=True)
        if search.returncode == 0:
            return search.stdout.split(":")[0]
    return None


def licence_of(package):
    """What its copyright file says of most of its files: SPDX's name or None, and Debian's."""
    try:
        text = pathlib.Path(f"/usr/share/doc/{package}/copyright").read_text(errors="replace")
    except OSError:
        return None, ""
    for paragraph in re.split(r"\n\s*\n", text):
        licence = re.search(r"^License:[ \t]*(\S.*)$", paragraph, re.MULTILINE)
        if licence and re.search(r"^Files:\s*\*\s*$", paragraph, re.MULTILINE):
            name = licence[1].strip()
            parts = [LICENCES.get(part.lower()) for part in re.split(r"\s+and\s+", name, flags=re.IGNORECASE)]
            return " AND ".join(parts) if all(parts) else None, name
    return None, ""


def entry(name, version, licence=None, **more):
    return {
        "SPDXID": "SPDXRef-" + re.sub(r"[^A-Za-z0-9.-]", "-", name),
        "name": name,
        "versionInfo": version,
        "downloadLocation": "NOASSERTION",
        "filesAnalyzed": False,
        "licenseConcluded": "NOASSERTION",
        "licenseDeclared": licence or "NOASSERTION",
        "copyrightText": "NOASSERTION",
        **more,
    }


def purl(locator):
    return [{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl", "referenceLocator": locator}]


def debian_entry(package):
    version, architecture = output_of(
        "dpkg-query", "--show", "--showformat=${Version} ${Architecture}", package
    ).split()
    licence, debian_name = licence_of(package)
    licence = licence or next((DECLARED[name] for name in DECLARED if package.startswith(name)), None)
    more = {} if licence or not debian_name else {"licenseComments": f"Debian's copyright file: {debian_name}"}
    distribution = re.search(r"^ID=(\w+)", pathlib.Path("/etc/os-release").read_text(), re.MULTILINE)[1]
    quoted = version.replace("+", "%2B").replace(":", "%3A")
    locator = f"pkg:deb/{distribution}/{package.replace('+', '%2B')}@{quoted}?arch={architecture}"
    return entry(package, version, licence, externalRefs=purl(locator), **more)


def download_entry(name):
    """The wheel as setup.sh pins it, with the hash that it noted when it fetched it."""
    function = (ROOT / "tools/setup.sh").read_text().split(f"install_{name}() {{")[1]
    version = re.search(r"version=(\S+)", function)[1]
    folder = ROOT / "third_party" / name / ("lib" if name == "onnxruntime" else "")
    sha256 = re.search(r"^# wheel ([0-9a-f]{64})$", (folder / "SHA256SUMS").read_text(), re.MULTILINE)[1]
    return entry(
        name, version, DOWNLOADS[name],
        checksums=[{"algorithm": "SHA256", "checksumValue": sha256}],
        externalRefs=purl(f"pkg:pypi/{name}@{version}"),
    )  # fmt: skip


def bill_of(program):
    version = re.search(r"project\(stemvo VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text())[1]
    digest = hashlib.sha256(pathlib.Path(program).read_bytes()).hexdigest()
    own = entry("stemvo", version, "MIT", checksums=[{"algorithm": "SHA256", "checksumValue": digest}])
    linked = {}
    for library, file in linked_libraries(program).items():
        if library.startswith("libonnxruntime.") or library.startswith("ld-linux"):
            continue  # below; a part of libc6
        package = file and package_of(file)
        if package is None:
            raise SystemExit(f"sbom: {library}: expected a library of a Debian package, found {file or 'none'}")
        linked.setdefault(package, debian_entry(package))
    parts = [(one, "DYNAMIC_LINK") for _, one in sorted(linked.items())]
    parts += [(debian_entry(package), "CONTAINS") for package in HEADERS_ONLY]
    parts += [(download_entry("onnxruntime"), "DYNAMIC_LINK"), (download_entry("plotly"), "CONTAINS")]
    relations = [("SPDXRef-DOCUMENT", "DESCRIBES", own["SPDXID"])]
    relations += [(own["SPDXID"], kind, part["SPDXID"]) for part, kind in parts]
    moment = int(os.environ.get("SOURCE_DATE_EPOCH", datetime.datetime.now().timestamp()))
    return {
        "spdxVersion": "SPDX-2.3",
        "dataLicense": "CC0-1.0",
        "SPDXID": "SPDXRef-DOCUMENT",
        "name": f"stemvo-{version}",
        "documentNamespace": f"https://spdx.org/spdxdocs/stemvo-{version}-{digest}",
        "creationInfo": {
            "created": datetime.datetime.fromtimestamp(moment, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
            "creators": ["Tool: stemvo-tools/sbom.py"],
        },
        "packages": [own] + [part for part, _ in parts],
        "relationships": [
            {"spdxElementId": one, "relationshipType": kind, "relatedSpdxElement": other}
            for one, kind, other in relations
        ],
    }


if __name__ == "__main__":
    if len(sys.argv) > 2:
        raise SystemExit("usage: sbom.py [PROGRAM]")
    json.dump(bill_of(sys.argv[1] if len(sys.argv) == 2 else ROOT / "build/release/stemvo"), sys.stdout, indent=2)
    print()
