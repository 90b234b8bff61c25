"""The thumbnails show what the scenes show now."""
import numpy as np
import pytest
from PIL import Image

from app.gallery import gallery, render_thumbnail

SMALL = 96, 60


@pytest.mark.parametrize("entry", gallery(), ids=lambda entry: entry.path.stem)
def test_a_thumbnail_is_its_scene_rendered(entry):
    """If not, `python -m app.gallery NAME` renders it anew. The mean difference in sRGB is at most 1.5 % where nothing has changed."""
    with Image.open(entry.thumbnail) as image:
        kept = np.asarray(image.resize(SMALL, Image.Resampling.BOX), float)
    now = np.asarray(render_thumbnail(entry.path, SMALL), float)
    assert np.abs(kept - now).mean() < 0.015 * 255
