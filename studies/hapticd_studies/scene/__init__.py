"""What a scene needs: the smallest model that keeps every answer, and what each term costs and changes."""
