"""The parts of the documentation site; `docs/make_pages.py` puts them together."""
