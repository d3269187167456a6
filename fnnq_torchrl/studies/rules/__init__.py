"""Commands that print, explain, draw and export the rules of finished jobs."""
