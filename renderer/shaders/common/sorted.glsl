// sorted: what every pass reads that draws a triangle a splat, the farthest first.
// Reads:   order, records and counts, of project and sort.
// Defines: the three buffers; record.glsl and triangle.glsl.
// Units:   those of record.glsl.
#include "common/record.glsl"
#include "common/triangle.glsl"

layout(std430, binding = SLOT_ORDER) readonly buffer Order { uint order[]; };  // near to far
layout(std430, binding = SLOT_RECORDS) readonly buffer Records { uvec4 records[]; };
layout(std430, binding = SLOT_COUNTS) readonly buffer Counts { uint counts[]; };
