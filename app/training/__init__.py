"""Commands that train scenes from photos and judge what came out."""
