"""Extremes: no longer in the package; an import says where the study is."""

raise ImportError(
    "jaxbiped.extremes is no longer part of the package: the study of extreme cases is "
    "experiments/extremes.py in jaxbiped's repository."
)
