"""Scenes, icons and meshes that come with Rayscope, found the same way in a checkout and in an installed wheel."""
from pathlib import Path

ROOT = Path(__file__).parent    # absolute; holds scenes/, icons/ and meshes/
