//! A moment as a picture (SVG, PNG) and as a table (CSV).
