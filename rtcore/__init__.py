"""rtcore: the ray tracer."""
