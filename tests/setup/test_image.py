"""The container image and the Debian root that stands for it in tests are made alike."""

import re
from pathlib import Path

DOCKER = Path(__file__).parents[2] / "docker"


def test_debian_is_tested_with_the_settings_of_the_image():
    image = (DOCKER / "Dockerfile").read_text(encoding="utf-8")
    settings = re.findall(r"[A-Z_a-z]+=\S+", re.search(r"ENV ((?:.*\\\n)*.*)", image)[1])
    assert len(settings) >= 6
    root = (DOCKER / "test-debian.sh").read_text(encoding="utf-8")
    assert not [setting for setting in settings if f" {setting} " not in root]


def test_what_the_image_is_made_from_is_in_its_build_context():
    image = (DOCKER / "Dockerfile").read_text(encoding="utf-8")
    copied = " ".join(re.findall(r"^COPY (.*) \S+$", image, re.MULTILINE)).split()
    kept = (DOCKER.parent / ".dockerignore").read_text(encoding="utf-8").splitlines()
    assert len(copied) >= 8
    for name in copied:
        assert f"!{name}" in kept
        assert (DOCKER.parent / name).exists()
