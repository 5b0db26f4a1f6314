"""A further stop of a finished scene: trained alone, while every other stop stays as it is.

How the parts go together:

    model    = insert_stop(model, "Wave", source="RGB", after="RGB")  # shows what RGB shows
    views    = dome_views(model, 48, (384, 288))             # or cameras of a file
    trainer  = StopTrainer(device, model, "Wave", StopSettings(heads=("color",)))
    train_on_pictures(trainer, views, pictures, PictureRun(steps=400))  # a StylePictures
    finished = trainer.finished()                            # an AnchorModel

What the stop is to show comes from outside.  `StylePictures` (style_pictures.py) is the interface
for everything that makes pictures: a network, files of another program, descent on the pixels.  It
is handed views with what the source stop shows there (`StyleView`), gives back a picture for each,
and says with its `turns` how often it wants to be asked again: once for all views, or by turns, a
few views at a time, with a few steps of training in between, made from what the new stop shows by
then.  Rules (style_rules.py) say it splat by splat instead; `train_on_rule` needs no pictures.
"""
