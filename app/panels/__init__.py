"""The panels: one file each. Listed once, here, in the order in which they stand."""
from app.panels.camera import CameraPanel
from app.panels.convergence import ConvergencePanel
from app.panels.fog import FogPanel
from app.panels.plan import PlanPanel
from app.panels.properties import PropertiesPanel
from app.panels.render import RenderPanel
from app.panels.stability import StabilityPanel
from app.panels.tree import TreePanel

PANELS = (TreePanel, CameraPanel, FogPanel, RenderPanel, PropertiesPanel, PlanPanel, StabilityPanel, ConvergencePanel)
