"""Python and its packages."""

import importlib.metadata
import re
import sys
from collections.abc import Iterable, Iterator

from deploy.compile.toolchain import COST, missing
from deploy.doctor.finding import Finding, bad, good, warning
from shared.compiled import PURE, ROOT, Form, form

OLDEST_PYTHON = (3, 11)
_NAME = "swarmtouch"
_EXTRAS = {
    "rosbag": "recordings from ROS bags",
    "plot": "pictures and reports",
    "secure": "keys, signatures, HTTPS for the console",
}
_REQUIREMENT = re.compile(r"""([\w.-]+).*?(?:extra == ['"](\w+)['"])?$""")


def check_python(version: tuple[int, ...] = sys.version_info[:3]) -> Finding:
    """Looks at the version of Python."""
    found = ".".join(map(str, version))
    if version[:2] < OLDEST_PYTHON:
        return bad("Python", found, "install Python 3.11 or newer and run make env again")
    return good("Python", found)


def check_packages() -> Iterator[Finding]:
    """Looks whether every required package is installed, and which extras are."""
    try:
        requirements = importlib.metadata.requires(_NAME) or []
    except importlib.metadata.PackageNotFoundError:
        yield bad(
            "packages", f"{_NAME} itself is not installed", "run make env, or pip install . in its folder"
        )
        return
    needed = _missing(requirements, None)
    if needed:
        yield bad("packages", f"missing: {', '.join(needed)}", "run make env, or pip install again")
    else:
        yield good("packages", "all that flying needs")
    for extra, purpose in _EXTRAS.items():
        missing = _missing(requirements, extra)
        if missing:
            advice = f"for {purpose}: pip install '{_NAME}[{extra}]'"
            yield warning(f"extra {extra}", f"missing: {', '.join(missing)}", advice)
        else:
            yield good(f"extra {extra}", purpose)


def check_law(law: Form) -> Finding:
    """Looks in which form the law would fly from here.

    Args:
        law: Of this process.
    """
    subject = "control law"
    if law.digest:
        return good(subject, f"{law} by {law.compiler}")
    found = f"{law}: {law.reason}; {COST}"
    if law.reason.startswith(PURE):
        return warning(subject, found, f"unset {PURE}")
    how = (
        "make compile" if (ROOT / "Makefile").exists() else "pip install again, from source or a compiled wheel"
    )
    return warning(subject, found, "; ".join([*missing(), how]))


def _missing(requirements: Iterable[str], extra: str | None) -> list[str]:
    parsed = (match.groups() for line in requirements if (match := _REQUIREMENT.match(line)))
    return [name for name, of in parsed if of == extra and not _is_installed(name)]


def _is_installed(name: str) -> bool:
    try:
        importlib.metadata.distribution(name)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def all_software() -> Iterator[Finding]:
    """Yields every finding about software."""
    yield check_python()
    yield from check_packages()
    yield check_law(form())
