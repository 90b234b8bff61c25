"""Saving scenes: all or nothing, links and permissions kept, and text that people like to read."""
import errno
import os

import pytest

from rtcore import files
from rtcore.files import WriteError
from rtcore.files import scene as scene_files
from rtcore.lights import Ambient, Point
from rtcore.scene import Material, Node, Scene, Translate
from rtcore.shapes import Sphere


def empty(folder):
    """A scene file without anything in it."""
    path = folder / "s.yaml"
    path.write_text("rayscope: 1\nscene: []\n")
    return path


def test_saving_is_all_or_nothing(tmp_path, monkeypatch):
    path = empty(tmp_path)
    before = path.read_bytes()

    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(WriteError, match=r"s\.yaml: cannot be written: No space left on device$"):
        files.save(Scene(name="new"), path)
    assert path.read_bytes() == before and os.listdir(tmp_path) == ["s.yaml"]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_saving_to_a_forbidden_folder_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(WriteError, match="cannot be written: Permission denied"):
        files.save(Scene(), tmp_path / "s.yaml")
    tmp_path.chmod(0o700)


@pytest.mark.parametrize(("name", "said"), [
    ("none/s.yaml", "cannot be written: there is no folder .*none"), ("folder.yaml", "cannot be written: it is a folder"),
    ("s.obj", "expected a name that ends in .yaml, .yml, .json, got '.obj'"), ("s\0.yaml", "cannot be written: a path holds no zero byte")])
def test_saving_to_an_impossible_place_is_refused(tmp_path, name, said):
    (tmp_path / "folder.yaml").mkdir()
    with pytest.raises(WriteError, match=said) as caught:
        files.save(Scene(), tmp_path / name)
    assert "\n" not in str(caught.value)


def test_text_that_utf8_can_not_hold_is_refused(tmp_path):
    for suffix in (".yaml", ".json"):
        with pytest.raises(WriteError, match="U\\+D83D"):
            files.save(Scene(name="\ud83d"), tmp_path / f"s{suffix}")
    assert os.listdir(tmp_path) == []


def test_a_link_is_followed_and_permissions_are_kept(tmp_path):
    path = empty(tmp_path)
    path.chmod(0o640)
    link = tmp_path / "link.yaml"
    link.symlink_to(path)
    files.save(Scene(name="new"), link)
    assert link.is_symlink() and files.load(path).name == "new" and path.stat().st_mode & 0o777 == 0o640


def test_a_scene_too_long_to_be_read_back_is_not_written(tmp_path, monkeypatch):
    monkeypatch.setattr(scene_files, "MOST_BYTES", 100)
    with pytest.raises(WriteError, match="which is all that is read back"):
        files.save(Scene(note="x" * 100), tmp_path / "s.yaml")
    assert os.listdir(tmp_path) == []


def test_the_order_of_the_words_is_that_of_their_records(tmp_path):
    scene = Scene(lights=(Point(position=(0, 1, 0), intensity=2, name="lamp"), Ambient(intensity=0.5)),
                  objects=(Node(name="ball", shape=Sphere(center=(0, 0, 0), radius=1, sides="front"), transform=[Translate((1, 0, 0))]),))
    files.save(scene, tmp_path / "s.yaml")
    assert (tmp_path / "s.yaml").read_text() == (
        "rayscope: 1\nlights:\n  - {point: {position: [0, 1, 0], intensity: 2, name: lamp}}\n  - {ambient: {intensity: 0.5}}\nscene:\n"
        "  - name: ball\n    sphere: {center: [0, 0, 0], radius: 1, sides: front}\n    transform: [{translate: [1, 0, 0]}]\n")


def test_a_material_by_name_stays_one(tmp_path):
    scene = Scene(objects=(Node(shape=Sphere(center=(0, 0, 0), radius=1), material="1"),), materials={"1": Material(ior=1.25)})
    files.save(scene, tmp_path / "s.yaml")
    back = files.load(tmp_path / "s.yaml")
    assert back == scene and back.materials["1"].ior == 1.25
