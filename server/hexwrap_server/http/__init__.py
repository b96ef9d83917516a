"""The service: its routes, its page, and what stands before them."""
