"""Reports: what the renderer is measured against, and the measuring. The renderer imports nothing of it."""
