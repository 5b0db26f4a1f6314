"""What is in the room over the splats: hands, controllers, the panel, cards, a glass."""
