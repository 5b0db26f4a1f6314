// new_stop: what a new stop's units add to the outputs of the stop that it starts from.
//
// Defined by stop_trainer.py: RAW, the numbers of an anchor's row of raw outputs.
// Reads:   raw (A, RAW) of the new units, source (A, RAW), may_change (A,) 0 or 1.
// Writes:  raw, in place; backward grad_raw (A, RAW), in place.
// Units:   none; raw outputs come before the activations.

// raw = source + what the new units add, where an anchor may change; one work-item a number.
__kernel void add_source(int count, __global const float *may_change,
                         __global const float *source, __global float *raw) {
  int i = get_global_id(0);
  if (!(i < count)) return;
  raw[i] = source[i] + may_change[i / RAW] * raw[i];
}

// The gradient of the units: none of anchors that stay.
__kernel void may_change_alone(int count, __global const float *may_change,
                               __global float *grad_raw) {
  int i = get_global_id(0);
  if (!(i < count)) return;
  grad_raw[i] *= may_change[i / RAW];
}
