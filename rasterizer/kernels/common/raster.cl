// What both forms of raster are given, in this order, and where a pixel of theirs ends.
// SURFACE adds a depth a splat (surface.cl), SHARE an error a pixel.
#include "common/tiles.cl"
#ifndef STOP        // drawing for the screen says where it stops
#define STOP 1e-5f  // so that the gradients stay within 1e-5 of those without a stop
#endif

#ifdef SURFACE
#include "common/surface.cl"
#define AND_SURFACE , __global const float* surface, __global float* metres
#define AND_SURFACE_BACKWARD                                                     \
  , __global const float* surface, __global const float* metres,                 \
      __global const float* grad_metres, __global float* depth_slots
#else
#define AND_SURFACE
#define AND_SURFACE_BACKWARD
#endif
#ifdef HEAT  // of the screen: value and weight of a splat, blended as its colour is
#define AND_HEAT , __global const float4* heat, __global float2* heat_image
#else
#define AND_HEAT
#endif
#ifdef SHARE
#define AND_SHARE , __global const float* error
#else
#define AND_SHARE
#endif

#define RASTERIZE_TAKES                                                                        \
  int width, int height, int tiles_x, __global const int* tile_start,                          \
      __global const int* intersections, __global const float* record, float red, float green,     \
      float blue, __global float* image, __global float* transmittance, __global int* tile_end \
      AND_SURFACE AND_HEAT

#define RASTERIZE_BACKWARD_TAKES                                                                 \
  int width, int height, int tiles_x, __global const int* tile_start,                            \
      __global const int* tile_end, __global const int* intersections, __global const uint2* tile_bounds, \
      __global const int* first_slot, __global const float* record,                              \
      __global const float* image, __global const float* transmittance,                          \
      __global const float* grad_image, __global const float* grad_transmittance,                \
      int with_transmittance, __global float* slots AND_SHARE AND_SURFACE_BACKWARD
