"""Rivals: learners and parts from the literature, for comparisons."""

WORDS = """
algorithm  quality_diversity  map-elites=map_elites_alone map-elites-taught=map_elites
algorithm  quality_diversity  isoline=isoline_alone isoline-taught=isoline
algorithm  quality_diversity  cma-me=cma_me_alone cma-me-taught=cma_me cma-mae=cma_mae_alone cma-mae-taught=cma_mae
goals      alp_gmm            alp-gmm=AlpGmm
search     cma_es             cma-es=CmaEs
"""
INSTALL = "rivals"
