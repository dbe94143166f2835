"""Fits what goes over the links to what they carry."""
