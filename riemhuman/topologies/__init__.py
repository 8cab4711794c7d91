"""Bodies of one topology as bodies of another, by a map or by a body model on the other mesh."""

from riemhuman.topologies.topology_map import TopologyMap
from riemhuman.topologies.transferred_models import transfer_model

__all__ = ["TopologyMap", "transfer_model"]


def __dir__() -> list[str]:
    return sorted(__all__)
