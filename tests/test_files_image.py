"""Pictures out: PNG by the sRGB curve with text, EXR in linear light, the old file intact when something goes wrong."""
import errno
import os

import numpy as np
import pytest
from PIL import Image

from rtcore.fields import srgb_from_linear
from rtcore.files import WriteError, image, save_image

RAMP = np.linspace(-0.2, 1.4, 3 * 40 * 7, dtype=np.float32).reshape(7, 40, 3)


def test_png_is_the_srgb_curve_to_the_nearest_of_256(tmp_path):
    save_image(RAMP, tmp_path / "a.png")
    exact = np.vectorize(srgb_from_linear)(RAMP.astype(float)) * 255
    got = np.asarray(Image.open(tmp_path / "a.png"))
    assert got.shape == RAMP.shape and np.abs(got - exact).max() <= 0.5 + 1e-3
    assert got.min() == 0 and got.max() == 255


def test_every_shade_of_gray_survives(tmp_path):
    from rtcore.fields import linear_from_srgb
    shades = np.array([linear_from_srgb(i / 255) for i in range(256)]).repeat(3).reshape(1, 256, 3)
    save_image(shades, tmp_path / "a.png")
    assert np.asarray(Image.open(tmp_path / "a.png"))[0, :, 0].tolist() == list(range(256))


def test_a_tall_picture_is_done_in_strips(monkeypatch):
    whole = image.srgb_bytes(RAMP)
    monkeypatch.setattr(image, "_ROWS", 80)
    assert np.array_equal(image.srgb_bytes(RAMP), whole)


def test_what_is_no_number_is_black_and_what_is_infinite_white(tmp_path):
    pixels = np.array([[[np.nan] * 3, [np.inf] * 3, [-np.inf] * 3]], np.float32)
    save_image(pixels, tmp_path / "a.png")
    assert np.asarray(Image.open(tmp_path / "a.png"))[0].tolist() == [[0] * 3, [255] * 3, [0] * 3]


def test_text_goes_along(tmp_path):
    save_image(RAMP, tmp_path / "a.png", text={"Title": "Kugel Nr. 1 ☃ é", "Samples": "16"})
    found = Image.open(tmp_path / "a.png")
    assert found.text == {"Software": "Rayscope", "Title": "Kugel Nr. 1 ☃ é", "Samples": "16"} and found.info["srgb"] == 0


def test_exr_keeps_linear_floats(tmp_path):
    OpenEXR = pytest.importorskip("OpenEXR", reason="needs the extra exr")
    pixels = RAMP * 1000
    pixels[0, 0] = np.inf
    save_image(pixels, tmp_path / "a.EXR", text={"Title": "☃"})
    with OpenEXR.File(str(tmp_path / "a.EXR")) as file:
        assert np.array_equal(file.channels()["RGB"].pixels, pixels) and file.channels()["RGB"].pixels.dtype == np.float32
        assert file.header()["title"] == "☃" and file.header()["software"] == "Rayscope"


def test_exr_without_its_package_is_refused_with_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "OpenEXR", None)
    with pytest.raises(WriteError, match=r"a\.exr: an \.exr file needs the package OpenEXR: pip install rayscope\[exr\]$"):
        save_image(RAMP, tmp_path / "a.exr")


@pytest.mark.parametrize(("name", "said"), [
    ("a.jpg", "expected a picture whose name ends in .png or .exr, got '.jpg'"),
    ("a", "expected a picture whose name ends in .png or .exr, got 'a'"),
    ("none/a.png", "cannot be written: there is no folder"), ("folder.png", "cannot be written: it is a folder")])
def test_impossible_places_are_refused(tmp_path, name, said):
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(WriteError) as caught:
        save_image(RAMP, tmp_path / name)
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_the_old_picture_is_intact_when_the_disk_is_full(tmp_path, monkeypatch):
    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    save_image(RAMP, tmp_path / "a.png")
    before = (tmp_path / "a.png").read_bytes()
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(WriteError, match="cannot be written: No space left on device"):
        save_image(RAMP * 0, tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes() == before and os.listdir(tmp_path) == ["a.png"]


def test_pixels_of_another_shape_are_an_error_of_the_caller():
    for shape in ((4, 4), (4, 4, 4), (0, 4, 3)):
        with pytest.raises(ValueError, match="expected pixels of shape"):
            save_image(np.zeros(shape), "a.png")
