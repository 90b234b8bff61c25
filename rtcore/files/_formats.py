"""The formats of scene files: the module of each, which has load(path) -> Scene, and the suffixes of its files."""
FORMATS = {"scene": (".yaml", ".yml", ".json"), "nff": (".nff",), "mesh": (".obj", ".ply", ".stl", ".glb", ".gltf", ".off")}
