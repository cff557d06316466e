"""Linear elastic solves by multigrid: what the nonsmooth method and the certificates of large problems rest on."""

from hemivar.linear.cycle import ElasticMultigrid

__all__ = ["ElasticMultigrid"]
