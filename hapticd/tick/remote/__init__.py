"""What other programs drive in a scene: a scene without any never runs it."""
