"""Materials of mesh files in the terms of ours: .mtl (Phong), glTF (metal and roughness), colours of vertices and faces.

A texture counts by its mean colour. Colours in .mtl files, textures, and the vertex colours of all but glTF are display
values (sRGB); glTF's factors and vertex colours are linear.
"""
import math
from typing import Any

import numpy as np

from rtcore.fields import FieldError, linear_from_srgb
from rtcore.scene import Material


def look_of(mesh: Any, suffix: str) -> tuple[str, Material] | None:
    """Name and material of a `trimesh.Trimesh` from a file of that suffix, or None if the file says nothing about its look."""
    try:
        visual = mesh.visual
        if visual.kind == "texture":
            material = visual.material
            if material is None:
                return None
            read = _from_gltf if hasattr(material, "baseColorFactor") else _from_mtl
            return str(getattr(material, "name", None) or "material"), read(material)
        if visual.kind in ("vertex", "face"):
            colors = np.asarray(visual.vertex_colors if visual.kind == "vertex" else visual.face_colors)[:, :3]
            return "colour", Material(color=_mean(colors, linear=suffix in (".glb", ".gltf")))
    except (FieldError, TypeError, ValueError, IndexError, KeyError, AttributeError, OSError):
        return None     # a look that can't be made out is no reason to refuse the shape
    return None


def _from_mtl(material: Any) -> Material:
    """Kd, Ks, Ns, Ke, d or Tr, Ni, Tf, illum and, as exporters have added it, Pr (roughness) of a Wavefront material.

    illum 3 to 9 ask for ray tracing; of those, 4, 6, 7 and 9 for glass, the others for a mirror of strength Ks.
    """
    raw = material.kwargs
    model = int(_number(raw.get("illum"), 2))
    alpha = _number(raw.get("d"), 1 - _number(raw.get("tr"), 0))
    color = _triple(raw.get("kd"), 0.8)
    if getattr(material, "image", None) is not None:
        color = color * _of_image(material.image)[0] if color.any() else _of_image(material.image)[0]
    shine = _level(raw.get("ks"), 0.0)
    traced = 3 <= model <= 9
    clear = (1 - alpha if alpha < 1 else _level(raw.get("tf"), 1.0)) if model in (4, 6, 7, 9) else 1 - alpha
    return Material(color=_linear(color), diffuse=_clip(alpha), specular=_clip(shine), shininess=max(_number(raw.get("ns"), 20.0), 1.0),
                    reflection=_clip(shine) if traced else 0.0, roughness=_clip(_number(raw.get("pr"), 0.0)), transmission=_clip(clear),
                    ior=1.5 if clear <= 0 else max(_number(raw.get("ni"), 1.5), 1e-3) if model in (6, 7) else 1.0,
                    emission=tuple(np.maximum(_triple(raw.get("ke"), 0.0), 0).tolist()))


def _from_gltf(material: Any) -> Material:
    """glTF's base colour, metal, roughness and emission. The exponent of the highlight is that of the Blinn-Phong lobe as wide
    as the microfacet one, 2/roughness⁴ - 2 (Walter and others, *Microfacet Models for Refraction*, 2007)."""
    factor = np.ones(4) if material.baseColorFactor is None else np.asarray(material.baseColorFactor, float) / 255
    image = material.baseColorTexture
    color, alpha = factor[:3], factor[3]
    if image is not None:
        mean, mean_alpha = _of_image(image)
        color, alpha = color * np.array(_linear(mean)), alpha * mean_alpha
    metal = _clip(1.0 if material.metallicFactor is None else material.metallicFactor)
    rough = _clip(1.0 if material.roughnessFactor is None else material.roughnessFactor)
    if material.metallicRoughnessTexture is not None:
        metal, rough = metal / 2, max(rough / 2, 0.25)     # the texture lowers them by an amount that no one number tells
    mirror = metal * (1 - rough) ** 2
    emission = np.zeros(3) if material.emissiveFactor is None else np.asarray(material.emissiveFactor, float)
    color = tuple(np.clip(color, 0, 1).tolist())
    clear = _clip(1 - alpha) if material.alphaMode == "BLEND" else 0.0
    return Material(color=color, diffuse=(1 - mirror) * (1 - clear), specular=_clip(0.04 + 0.3 * (1 - rough) + 0.5 * metal * (1 - rough)),
                    shininess=float(np.clip(2 / max(rough, 0.15) ** 4 - 2, 2, 2000)),
                    reflection=mirror, roughness=rough if mirror else 0.0, tint=color if mirror else (1.0, 1.0, 1.0),
                    transmission=clear, ior=1.0 if clear else 1.5, emission=tuple(np.maximum(emission, 0).tolist()))


def _mean(colors: np.ndarray, linear: bool) -> tuple[float, float, float]:
    """Mean of (N, 3) colours of 8 bits a channel, linear."""
    table = np.arange(256) / 255 if linear else np.array([linear_from_srgb(i / 255) for i in range(256)])
    return tuple(table[np.asarray(colors, np.uint8)].mean(axis=0).tolist())


def _of_image(image: Any) -> tuple[np.ndarray, float]:
    """Mean colour, as display values 0 to 1, and mean alpha of a Pillow image."""
    small = np.asarray(image.convert("RGBA").resize((16, 16), 4), float).reshape(-1, 4) / 255     # 4: box filter
    return small[:, :3].mean(axis=0), float(small[:, 3].mean())


def _number(value: Any, otherwise: float) -> float:
    """The first finite number of what an .mtl line held, or `otherwise`."""
    try:
        result = float(value[0] if isinstance(value, (list, tuple)) else value)
    except (TypeError, ValueError, IndexError):
        return otherwise
    return result if np.isfinite(result) else otherwise


def _triple(value: Any, otherwise: float) -> np.ndarray:
    """Three numbers of an .mtl line; one number stands for three."""
    values = [_number(v, otherwise) for v in value[:3]] if isinstance(value, (list, tuple)) else [_number(value, otherwise)]
    return np.array(values if len(values) == 3 else values[:1] * 3)


def _level(value: Any, otherwise: float) -> float:
    """Mean of three numbers of an .mtl line."""
    return math.fsum(_triple(value, otherwise)) / 3


def _linear(color: np.ndarray) -> tuple[float, float, float]:
    """Linear from display values, both clipped to 0 .. 1."""
    return tuple(linear_from_srgb(float(c)) for c in np.clip(color, 0, 1))


def _clip(value: float) -> float:
    return float(min(max(value, 0.0), 1.0))
