"""Maximum intensity projections of several packages, one in each file; benchmark/peers.py compares them."""
