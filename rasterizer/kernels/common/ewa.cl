// ewa: a 3D Gaussian in front of a pinhole -> its 2D Gaussian on the screen, and the way back. EWA
// splatting (Zwicker et al. 2001) as 3DGS has it (Kerbl et al. 2023, eq. 5 and 6):
//  Sigma  = R S S^T R^T         rotation R, diagonal scales S (paper eq. 1)
//  Sigma' = J W Sigma W^T J^T   W turns the world into the camera, J is the Jacobian of the
//                               perspective at the mean
// and with M = W R S that is Sigma' = (J M) (J M)^T: the dot products of the two rows of J M.
// Reads:   WIDTH, of lanes.cl.
// Defines: Splat; project_splat(); rotation_scale_backward(); camera_row(); times3().
// Units:   metres and pixels; camera axes x right, y down, z forward; scales are one sigma.
#include "common/camera.cl"
#include "common/lanes.cl"

// A splat as both directions need it; the backward pass computes it anew, nothing of it is stored.
typedef struct {
  floatn3 p;                  // mean in the camera, metres
  floatn w, x, y, z;          // unit quaternion
  floatn inv_norm;            // 1 / length of the quaternion as given
  floatn3 scale;
  floatn3 wr_x, wr_y, wr_z;   // rows of W R, the rotation camera_from_splat
  floatn3 m_x, m_y, m_z;      // rows of M = W R S; W Sigma W^T = M M^T
  floatn3 jm_x, jm_y;         // rows of J M
  floatn j00, j02, j11, j12;  // J = [j00 0 j02; 0 j11 j12], pixels per metre
  // 1 / z; Sigma' + low pass = [a b; b c], px^2; its determinant, px^4
  floatn inv_z, a, b, c, determinant;
} Splat;

// One row of camera_from_world times (v, 1).
inline floatn camera_row(__constant float* camera, int row, floatn3 v) {
  __constant float* m = camera + 4 * row;
  return m[0] * v.x + m[1] * v.y + m[2] * v.z + m[3];
}

inline floatn3 times3(floatn3 a, floatn3 b) { return make3(a.x * b.x, a.y * b.y, a.z * b.z); }

inline Splat project_splat(floatn3 mean, floatn3 scale, floatn qw, floatn qx, floatn qy, floatn qz,
                   __constant float* camera, float low_pass) {
  Splat s;
  s.p.x = camera_row(camera, 0, mean);
  s.p.y = camera_row(camera, 1, mean);
  s.p.z = camera_row(camera, 2, mean);
  s.scale = scale;
  // Step 1: R of the quaternion, made a unit one.
  // By the largest entry first: neither tiny nor huge quaternions lose their length.
  const floatn largest = fmax(fmax(fabs(qw), fabs(qx)), fmax(fabs(qy), fabs(qz)));
  const floatn per = 1 / largest;  // not finite where there is no direction
  s.w = qw * per;
  s.x = qx * per;
  s.y = qy * per;
  s.z = qz * per;
  const floatn inverse = 1 / sqrt(s.w * s.w + s.x * s.x + s.y * s.y + s.z * s.z);
  s.w *= inverse;
  s.x *= inverse;
  s.y *= inverse;
  s.z *= inverse;
  s.inv_norm = inverse * per;
  // The rotation matrix of a unit quaternion, row by row.
  const floatn w = s.w, x = s.x, y = s.y, z = s.z;
  const floatn3 r0 = make3(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y));
  const floatn3 r1 = make3(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x));
  const floatn3 r2 = make3(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y));
  // Step 2: W R, then M = W R S: every column of W R by its scale.
  floatn3 wr[3];
  for (int row = 0; row < 3; row++) {
    const float m0 = camera[4 * row], m1 = camera[4 * row + 1], m2 = camera[4 * row + 2];
    wr[row] = make3(m0 * r0.x + m1 * r1.x + m2 * r2.x, m0 * r0.y + m1 * r1.y + m2 * r2.y,
                    m0 * r0.z + m1 * r1.z + m2 * r2.z);
  }
  s.wr_x = wr[0];
  s.wr_y = wr[1];
  s.wr_z = wr[2];
  s.m_x = times3(s.wr_x, scale);
  s.m_y = times3(s.wr_y, scale);
  s.m_z = times3(s.wr_z, scale);

  // Step 3: J, the derivative of (fx x / z + cx, fy y / z + cy).  x_px does not
  // change with y nor y_px with x; the tangents x / z, y / z are held as in 3DGS (camera.cl).
  s.inv_z = 1 / s.p.z;
  const floatn tan_x = fmin(fmax(s.p.x * s.inv_z, camera[MIN_TAN_X]), camera[MAX_TAN_X]);
  const floatn tan_y = fmin(fmax(s.p.y * s.inv_z, camera[MIN_TAN_Y]), camera[MAX_TAN_Y]);
  s.j00 = camera[CAMERA_FX] * s.inv_z;
  s.j11 = camera[CAMERA_FY] * s.inv_z;
  s.j02 = -s.j00 * tan_x;
  s.j12 = -s.j11 * tan_y;
  // Step 4: J M, and Sigma' of its rows, plus the low pass: every splat covers about a pixel, the
  // screen filter of EWA (3DGS: 0.3 px^2).
  s.jm_x = blend3(s.j00, s.m_x, s.j02, s.m_z);
  s.jm_y = blend3(s.j11, s.m_y, s.j12, s.m_z);
  const floatn a = dot3(s.jm_x, s.jm_x), c = dot3(s.jm_y, s.jm_y);
  s.a = a + low_pass;
  s.b = dot3(s.jm_x, s.jm_y);
  s.c = c + low_pass;
  // Step 5: the determinant of Sigma' with the low pass, by Lagrange's identity:
  // a c - b^2 cancels for long thin splats; |jm_x x jm_y|^2 is the same without the loss.
  const floatn3 area = make3(s.jm_x.y * s.jm_y.z - s.jm_x.z * s.jm_y.y,
                             s.jm_x.z * s.jm_y.x - s.jm_x.x * s.jm_y.z,
                             s.jm_x.x * s.jm_y.y - s.jm_x.y * s.jm_y.x);
  s.determinant = dot3(area, area) + low_pass * (a + c) + low_pass * low_pass;
  return s;
}

// Gradients of the scales and of the quaternion as given, from those of M's rows (gx, gy, gz).  M =
// W R S, so dL/dS_k is the sum of column k of dL/dM and W R multiplied entry by entry, and dL/dR =
// W^T (dL/dM S).
inline void rotation_scale_backward(const Splat* s, __constant float* camera, floatn3 gx,
                                    floatn3 gy, floatn3 gz, floatn3* grad_scale,
                                    floatn* grad_wxyz) {
  const floatn3 tx = times3(gx, s->wr_x), ty = times3(gy, s->wr_y), tz = times3(gz, s->wr_z);
  *grad_scale = make3(tx.x + ty.x + tz.x, tx.y + ty.y + tz.y, tx.z + ty.z + tz.z);
  const floatn3 ux = times3(gx, s->scale), uy = times3(gy, s->scale), uz = times3(gz, s->scale);
  // Rows of dL/dR = W^T (dL/dM S).
  floatn3 g[3];
  for (int row = 0; row < 3; row++)
    g[row] = make3(camera[row] * ux.x + camera[4 + row] * uy.x + camera[8 + row] * uz.x,
                   camera[row] * ux.y + camera[4 + row] * uy.y + camera[8 + row] * uz.y,
                   camera[row] * ux.z + camera[4 + row] * uy.z + camera[8 + row] * uz.z);
  // dR / dq of the rotation matrix above, entry by entry, times dL/dR and summed up.
  const floatn w = s->w, x = s->x, y = s->y, z = s->z;
  const floatn dw =
      2 * (-z * g[0].y + y * g[0].z + z * g[1].x - x * g[1].z - y * g[2].x + x * g[2].y);
  const floatn dx = 2 * (y * (g[0].y + g[1].x) + z * (g[0].z + g[2].x) - 2 * x * (g[1].y + g[2].z) +
                         w * (g[2].y - g[1].z));
  const floatn dy = 2 * (x * (g[0].y + g[1].x) + z * (g[1].z + g[2].y) - 2 * y * (g[0].x + g[2].z) +
                         w * (g[0].z - g[2].x));
  const floatn dz = 2 * (x * (g[0].z + g[2].x) + y * (g[1].z + g[2].y) - 2 * z * (g[0].x + g[1].y) +
                         w * (g[1].x - g[0].y));
  // Through q = given / |given| only what is across q remains: (I - q q^T) / |given|.
  const floatn along = dw * w + dx * x + dy * y + dz * z;
  grad_wxyz[0] = (dw - along * w) * s->inv_norm;
  grad_wxyz[1] = (dx - along * x) * s->inv_norm;
  grad_wxyz[2] = (dy - along * y) * s->inv_norm;
  grad_wxyz[3] = (dz - along * z) * s->inv_norm;
}
