// Real spherical harmonics up to degree 3, with the signs of 3DGS (Kerbl 2023): Y of order m carries (-1)^m.
layout(constant_id = 10) const uint SH_DEGREE = 3;

// Basis functions of a unit vector; those beyond SH_DEGREE are not set.
void sh_basis(vec3 d, out float basis[16]) {
    float x = d.x, y = d.y, z = d.z;
    basis[0] = SH_C0;
    if (SH_DEGREE < 1) return;
    basis[1] = -0.4886025119029199 * y;
    basis[2] = 0.4886025119029199 * z;
    basis[3] = -0.4886025119029199 * x;
    if (SH_DEGREE < 2) return;
    float xx = x * x, yy = y * y, zz = z * z;
    basis[4] = 1.0925484305920792 * x * y;
    basis[5] = -1.0925484305920792 * y * z;
    basis[6] = 0.31539156525252005 * (2.0 * zz - xx - yy);
    basis[7] = -1.0925484305920792 * x * z;
    basis[8] = 0.5462742152960396 * (xx - yy);
    if (SH_DEGREE < 3) return;
    basis[9] = -0.5900435899266435 * y * (3.0 * xx - yy);
    basis[10] = 2.890611442640554 * x * y * z;
    basis[11] = -0.4570457994644658 * y * (4.0 * zz - xx - yy);
    basis[12] = 0.3731763325901154 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy);
    basis[13] = -0.4570457994644658 * x * (4.0 * zz - xx - yy);
    basis[14] = 1.445305721320277 * z * (xx - yy);
    basis[15] = -0.5900435899266435 * x * (xx - 3.0 * yy);
}

// Gradient of basis function k as a polynomial in (x, y, z).
vec3 sh_basis_gradient(vec3 d, uint k) {
    float x = d.x, y = d.y, z = d.z;
    switch (k) {
        case 1: return vec3(0.0, -0.4886025119029199, 0.0);
        case 2: return vec3(0.0, 0.0, 0.4886025119029199);
        case 3: return vec3(-0.4886025119029199, 0.0, 0.0);
        case 4: return 1.0925484305920792 * vec3(y, x, 0.0);
        case 5: return -1.0925484305920792 * vec3(0.0, z, y);
        case 6: return 0.31539156525252005 * vec3(-2.0 * x, -2.0 * y, 4.0 * z);
        case 7: return -1.0925484305920792 * vec3(z, 0.0, x);
        case 8: return 0.5462742152960396 * vec3(2.0 * x, -2.0 * y, 0.0);
        case 9: return -0.5900435899266435 * vec3(6.0 * x * y, 3.0 * (x * x - y * y), 0.0);
        case 10: return 2.890611442640554 * vec3(y * z, x * z, x * y);
        case 11: return -0.4570457994644658 * vec3(-2.0 * x * y, 4.0 * z * z - x * x - 3.0 * y * y, 8.0 * y * z);
        case 12: return 0.3731763325901154 * vec3(-6.0 * x * z, -6.0 * y * z, 6.0 * z * z - 3.0 * (x * x + y * y));
        case 13: return -0.4570457994644658 * vec3(4.0 * z * z - 3.0 * x * x - y * y, -2.0 * x * y, 8.0 * x * z);
        case 14: return 1.445305721320277 * vec3(2.0 * x * z, -2.0 * y * z, x * x - y * y);
        case 15: return -0.5900435899266435 * vec3(3.0 * (x * x - y * y), -6.0 * x * y, 0.0);
    }
    return vec3(0.0);
}
