"""The printable game: cards, the playing field, and sheets for cameras, as a PDF in real millimetres."""
