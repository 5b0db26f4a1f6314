"""How alike are two scenes?  PSNR, SSIM and sheets of pictures, in the same views of both."""

import shapeshift as ss

scene = ss.load(ss.DEMO)
written = scene.export("out/05_rgb.spz", x="RGB", overwrite=True)

# What does the format cost?  The scene at its stop, beside the file that was just written.
result = scene.at("RGB").compare(written.path, size=(320, 180), out="out/05_diff", overwrite=True)
for row in result["views"]:
    print(f"view {row['view']}: {row['psnr_db']:.1f} dB, SSIM {row['ssim']:.4f}")
print(f"mean {result['mean']['psnr_db']:.1f} dB; the sheets are in out/05_diff")

# Two arrays do as well.
a, b = scene.render("RGB", size=(320, 180)), scene.render("Opened", size=(320, 180))
print(f"RGB beside Opened: {ss.psnr(a, b):.1f} dB, SSIM {ss.ssim(a, b):.3f}")
