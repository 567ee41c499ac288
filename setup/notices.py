"""Puts the licences of bundled libraries and a bill of materials into a repaired wheel.

    python setup/notices.py WHEEL FOLDER      writes the whole wheel into FOLDER

Which libraries are inside, the wheel says itself (exactarm.libs). The notice of each is that of the Debian
package that it came from (/usr/share/doc/PACKAGE/copyright); a library without one is an error. The bill of
materials is CycloneDX 1.5, dist-info/sboms/bundled.cdx.json.
"""

import hashlib
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path


def output(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def package_of(library: Path) -> tuple[str, str]:
    """Debian package and version that own the library which auditwheel has copied and renamed."""
    stem = re.sub(r"-[0-9a-f]{8}(?=\.so|\.[0-9])", "", library.name)
    for folder in ("/usr/lib/x86_64-linux-gnu", "/lib/x86_64-linux-gnu", "/usr/lib", "/lib"):
        name = stem.split(".so")[0] + "*"
        for found in sorted(Path(folder).glob(name)) + sorted(Path(folder).glob(f"*/{name}")):
            owners = subprocess.run(["dpkg", "-S", found.resolve(), found], capture_output=True,
                                    text=True).stdout
            names = [line.split(":")[0] for line in owners.splitlines()
                     if "diversion" not in line and "-dev" not in line]
            if names:
                return names[0], output("dpkg-query", "-W", "-f", "${Version}", names[0])
    sys.exit(f"{library.name}: no Debian package owns it, so its licence is unknown")


def component(library: Path, package: str, version: str) -> dict:
    digest = hashlib.sha256(library.read_bytes()).hexdigest()
    return {"type": "library", "name": package, "version": version,
            "purl": f"pkg:deb/debian/{package}@{version}?distro=debian-12",
            "hashes": [{"alg": "SHA-256", "content": digest}],
            "properties": [{"name": "file", "value": library.name}]}


def main() -> None:
    wheel, folder = Path(sys.argv[1]), Path(sys.argv[2])
    with tempfile.TemporaryDirectory() as scratch:
        output(sys.executable, "-m", "wheel", "unpack", str(wheel), "--dest", scratch)
        (top,) = Path(scratch).iterdir()
        (info,) = top.glob("*.dist-info")
        licences, bill = info / "licenses", []
        licences.mkdir(exist_ok=True)
        for library in sorted((top / "exactarm.libs").iterdir()):
            package, version = package_of(library)
            bill.append(component(library, package, version))
            (licences / f"{package}.txt").write_bytes(
                Path(f"/usr/share/doc/{package}/copyright").read_bytes()
            )
        (info / "sboms").mkdir(exist_ok=True)
        document = {"bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1, "components": bill}
        (info / "sboms" / "bundled.cdx.json").write_text(json.dumps(document, indent=1) + "\n")
        output(sys.executable, "-m", "wheel", "pack", str(top), "--dest-dir", str(folder))
    print("bundled: " + ", ".join(f"{part['name']} {part['version']}" for part in bill))


if __name__ == "__main__":
    main()
