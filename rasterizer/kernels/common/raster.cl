// raster: the arguments of both forms of raster, in this order, and where a pixel of theirs ends.
// Reads:   STOP, SURFACE, HEAT and SHARE, as the host defines them.
// Defines: RASTERIZE_TAKES, RASTERIZE_BACKWARD_TAKES and what SURFACE (a depth a splat,
//          surface.cl), HEAT and SHARE (an error a pixel) add to them.
// Units:   pixels; images are planar (3, H, W); transmittance 0..1; depth in metres.
#include "common/tiles.cl"
// The least transmittance: a pixel with less left is done.  3DGS stops at 1e-4.
#ifndef STOP        // drawing for the screen says where it stops
#define STOP 1e-5f  // so that the gradients stay within 1e-5 of those without a stop
#endif

// `metres` is the sum of alpha T z, blended as the colours are (paper eq. 2 with z for c).
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

// Lists of intersections, tile by tile: tile t has those from tile_start[t] to tile_start[t + 1].
#define RASTERIZE_TAKES                                                                         \
  int width, int height, int tiles_x, __global const int* tile_start,                           \
      __global const int* intersections, __global const float* record, float red, float green,  \
      float blue, __global float* image, __global float* transmittance, __global int* tile_end  \
      AND_SURFACE AND_HEAT

// The backward pass writes the gradient of an intersection to a slot of its own, since a
// splat lies in several tiles and float atomics would sum them in a new order every time.
#define RASTERIZE_BACKWARD_TAKES                                                                 \
  int width, int height, int tiles_x, __global const int* tile_start,                            \
      __global const int* tile_end, __global const int* intersections,                           \
      __global const uint2* tile_bounds,                                                         \
      __global const int* first_slot, __global const float* record,                              \
      __global const float* image, __global const float* transmittance,                          \
      __global const float* grad_image, __global const float* grad_transmittance,                \
      int with_transmittance, __global float* slots AND_SHARE AND_SURFACE_BACKWARD
