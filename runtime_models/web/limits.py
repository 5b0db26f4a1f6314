"""What a web page can hold and how finely its tables are stored: for web/conventions.js, too."""

WIDTH = 2048  # texels a row of a list: the least that every WebGL2 driver allows
BATCH_ROWS = 64  # of anchors that are decoded at once: 131,072, 36 MB between two passes
BLOCK_VEC4S = 1024  # of a uniform block: 16 kB, the least that every WebGL2 driver allows
MOST_ANCHORS = 4_000_000  # of plain splats, too
MOST_SPLATS = 4_194_304  # WIDTH rows of a list
MOST_BYTES = 1 << 30  # of a scene, inflated
MOST_WEIGHTS = 8 * 4 * BLOCK_VEC4S  # of one network: 8 of the 12 blocks that a shader may have
LARGEST_FILE = 24_000_000  # bytes in one HTML file: above, browsers take long to open it
FEATURE_BITS = 9  # 10 make the page of the demo larger than its package
FRAME_BITS = 12  # of scales, by their logarithm, and quaternions
COLOR_BITS = 12  # of harmonics of degree 0, and opacities
HARMONIC_BITS = 8  # of degree 1 and above
POSITION_STEP = 1e-4  # of the scene's radius: where 16 bits are coarser, 24 are taken
