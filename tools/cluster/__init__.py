# SPDX-License-Identifier: MIT
"""The filter search on a Ray cluster: what search_cluster.py is made of."""
