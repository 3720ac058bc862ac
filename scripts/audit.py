"""Look up the locked packages, Python's and the page's, in the advisory databases.

A registry mirror may know packages but no advisories. What could not be looked up is then said, and is no failure;
`--strict` makes it one, for a machine that reaches the real databases.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
# The first has what requirements.lock has too. Every environment of the Makefile is made from one of them.
LOCKS = ("requirements-dev.lock", "requirements-ros2.lock", "requirements-lerobot.lock", "requirements-docs.lock")
SECONDS = 300


def _run(*command: str) -> str:
    finished = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=SECONDS, check=False)
    return finished.stdout


def _python(lock: str) -> tuple[list[str], str]:
    """Return the vulnerabilities of a lock file's packages, and what was not looked up."""
    flags = ("--disable-pip", "--require-hashes", "-r", lock)
    answer: dict[str, Any] = json.loads(_run(sys.executable, "-m", "pip_audit", "-f", "json", *flags) or "{}")
    packages = answer.get("dependencies", [])
    found = [f"{each['name']} {vuln['id']} ({lock})" for each in packages for vuln in each.get("vulns", [])]
    skipped = sum("skip_reason" in each for each in packages)
    missed = "" if packages and not skipped else f"{skipped or 'all'} of the Python packages in {lock}"
    return found, missed


def _page() -> tuple[list[str], str]:
    answer: dict[str, Any] = json.loads(_run("npm", "--prefix", "web", "audit", "--json") or "{}")
    if "vulnerabilities" not in answer:
        return [], "the page's packages"
    return [f"{name} ({each['severity']})" for name, each in answer["vulnerabilities"].items()], ""


def main(arguments: list[str]) -> int:
    found: list[str] = []
    for vulnerabilities, missed in (*map(_python, LOCKS), _page()):
        found += vulnerabilities
        if missed:
            print(f"audit: no advisories could be had for {missed}", file=sys.stderr)
            if "--strict" in arguments:
                return 1
    for each in found:
        print(f"audit: vulnerable: {each}", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
