from samples import image as image
from samples import isolated as isolated
from samples import oblique_view as oblique_view
from samples import rng as rng
