"""Integrals over the lining, split where contact is lost and where slip reverses."""
