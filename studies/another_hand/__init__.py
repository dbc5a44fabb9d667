"""Campaigns that were simulated by another hand, and what a diagnosis says of them."""
