"""The engine and our image, once per session."""

from collections.abc import Iterator

import pytest

from tests.container.engine import NoEngineError, base_image, docker, engine, succeeds
from tests.container.project import IMAGE, ROOT


@pytest.fixture(scope="session")
def base() -> Iterator[str]:
    """Name of the base image, on an engine that runs."""
    try:
        with engine():
            name = base_image()
            if not succeeds("docker", "run", "--rm", name, "true"):
                raise NoEngineError("the engine answers, but cannot run a container here")
            yield name
    except NoEngineError as reason:
        pytest.skip(str(reason))


@pytest.fixture(scope="session")
def image(base: str) -> str:
    """Our image, built as a user would."""
    file = str(ROOT / "deploy/docker/Dockerfile")
    docker("build", "--quiet", "--build-arg", f"BASE={base}", "--file", file, "--tag", IMAGE, str(ROOT))
    return IMAGE
