"""A small random model with two stops of values, as bands of a multispectral camera."""

from dataclasses import replace

from shapeshift.runtime_models.model import AnchorModel, Stop
from shapeshift.runtime_models.package.feature_codes import decode_features, encode_features
from shapeshift.runtime_models.package.refit_encoding import encoding_for
from tests.support.models import make_random_model
from tests.support.new_stops import framed_model

EYES = [[2.0, 1.0, 0.5], [-1.0, 2.0, 3.0]]
BANDS = (
    Stop("Red", 0.0, "values", "gray", (0.0, 1.0), ""),
    Stop("NIR", 0.5, "values", "gray", (0.1, 2.1), ""),
    Stop("RGB", 1.0),
)


def band_model(kind: str = "float16", framed: bool = False) -> AnchorModel:
    """A random model of three stops; framed: with anchors' own frames, as training makes them."""
    encoding = encoding_for([stop.x for stop in BANDS])
    model = framed_model(150) if framed else make_random_model(150, k=3, seed=1, encoding=encoding)
    coded = encode_features(model.features, kind)
    features = decode_features(coded["features"], coded.get("feature_range"), "")
    return replace(model, stops=BANDS, features=features, provenance={"eyes": EYES}, pace=())
