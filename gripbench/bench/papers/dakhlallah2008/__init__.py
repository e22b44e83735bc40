"""Dakhlallah, Glaser, Mammar & Sebsadji (2008): claims run again and figures."""
