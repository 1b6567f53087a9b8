"""What pages are made of: sections with tables and plots, and how engines look in them."""
