"""What people see: text, progress, notebooks, pictures, pages."""
