"""Errors of receivers that begin with a jump: found, sized, taken out."""
