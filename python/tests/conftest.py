"""Scenes of the tests."""

from pathlib import Path

import pytest

import flank

ROOT = Path(__file__).parents[2]
SCENES = ROOT / "examples" / "scenes"


@pytest.fixture
def pair() -> flank.Scene:
    """Pair of Kahraman and Singh with separations: 500 cycles, period 1."""
    return flank.load(SCENES / "kahraman-singh.json")


@pytest.fixture
def spur() -> flank.Scene:
    return flank.load(SCENES / "spur-pair.json")
