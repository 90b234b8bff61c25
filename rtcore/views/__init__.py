"""Views: one file each, what a finished or growing film is shown as. Listed once, here."""
from rtcore.views.barycentrics import BARYCENTRICS
from rtcore.views.beauty import BEAUTY
from rtcore.views.certified import CERTIFIED
from rtcore.views.cost import COST
from rtcore.views.depth import DEPTH
from rtcore.views.error import ERROR
from rtcore.views.material import MATERIAL
from rtcore.views.normal import NORMAL
from rtcore.views.object import OBJECT
from rtcore.views.samples import SAMPLES
from rtcore.views.shadow import SHADOW

VIEWS = (BEAUTY, NORMAL, DEPTH, OBJECT, MATERIAL, BARYCENTRICS, SHADOW, COST, CERTIFIED, SAMPLES, ERROR)
