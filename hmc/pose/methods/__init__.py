"""The pose methods: a short file each, with the presets of their papers."""
