#!/usr/bin/env python3
"""Writes calibrations of a depth camera by a board; the same in every run.

board_problems.py OUT writes OUT/board_<grid>_<C>.txt:
  line 1 : "C N sigma_px sigma_invz"
  line 2 : truth  fx fy cx cy k1 k2 p1 p2 k3 d1 d2 d3 d4
  line 3 : init   (same layout)
  N lines: board point X Y Z [mm]
  per frame: one line "rvec(3) t(3)" truth, one line init, then N lines "u v z_meas[mm]"
Model: X_c = R(rvec) X + t; x=X/Z,y=Y/Z; Brown-Conrady; pixels.
Depth: z_meas = Z/(d1 X + d2 Y + d3 Z + d4), noise sigma_z = 0.5 mm (Z/500)^2
       (=> constant noise 2e-6 1/mm in 1/z).
"""
import sys, os, numpy as np

K = np.array([477.3, 476.8, 313.2, 242.1])
DIST = np.array([-0.1468, 0.0463, 0.0012, -0.0007, -0.0756])
D = np.array([1.34e-4, -3.5e-6, -7e-6, 1.006])
SIG_PX = 0.1
SIG_IZ = 0.5 / 500.0**2
GRID = {"44": (4, 11, 17.0), "27": (3, 9, 21.0), "r44": (4, 11, 22.0)}   # per row, rows, (half-)pitch mm; r44 = regular grid (mrcal needs one)

def rodrigues(r):
    th = np.linalg.norm(r)
    if th < 1e-12: return np.eye(3)
    k = r / th; Kx = np.array([[0,-k[2],k[1]],[k[2],0,-k[0]],[-k[1],k[0],0]])
    return np.eye(3) + np.sin(th)*Kx + (1-np.cos(th))*(Kx@Kx)

def project(Xc, k, dist):
    x, y = Xc[:,0]/Xc[:,2], Xc[:,1]/Xc[:,2]
    r2 = x*x+y*y
    g = 1+r2*(dist[0]+r2*(dist[1]+r2*dist[4]))
    xd = x*g+2*dist[2]*x*y+dist[3]*(r2+2*x*x)
    yd = y*g+dist[2]*(r2+2*y*y)+2*dist[3]*x*y
    return np.stack([k[0]*xd+k[2], k[1]*yd+k[3]], 1)

def board(name):
    per, rows, s = GRID[name]
    if name[0] == "r": return np.array([[c*s, r*s, 0.0] for r in range(rows) for c in range(per)])
    return np.array([[(2*c + r % 2)*s, r*s, 0.0] for r in range(rows) for c in range(per)])

def main(name, C, path):
    B = board(name); ctr = B.mean(0); N = len(B)
    rng = np.random.default_rng(1000*N + C)
    init_K = K*np.array([1.04, 0.97, 1.0, 1.0]) + np.array([0, 0, 9.0, -7.0])
    with open(path, "w") as f:
        f.write(f"{C} {N} {SIG_PX!r} {SIG_IZ!r}\n")
        f.write(" ".join(repr(float(v)) for v in np.r_[K, DIST, D]) + "\n")
        f.write(" ".join(repr(float(v)) for v in np.r_[init_K, np.zeros(5), 0, 0, 0, 1.0]) + "\n")
        for p in B: f.write("%.17g %.17g %.17g\n" % tuple(p))
        n = 0
        while n < C:
            axis = rng.normal(size=3); axis[2] *= 0.6
            r = axis/np.linalg.norm(axis)*np.deg2rad(rng.uniform(0, 45))
            R = rodrigues(r)
            z = rng.uniform(300, 1500)
            c = np.array([rng.uniform(-.62, .62)*z, rng.uniform(-.47, .47)*z, z])
            t = c - R@ctr
            Xc = B@R.T + t
            if Xc[:,2].min() < 150: continue
            if (np.hypot(Xc[:,0], Xc[:,1])/Xc[:,2]).max() > 0.85: continue
            uv = project(Xc, K, DIST)
            if uv.min() < 2 or uv[:,0].max() > 637 or uv[:,1].max() > 477: continue
            Z = Xc[:,2]
            zm = Z/(Xc@D[:3] + D[3]); zm = zm + rng.normal(size=N)*0.5*(Z/500)**2
            uv = uv + rng.normal(size=uv.shape)*SIG_PX
            ri = r + rng.normal(size=3)*0.03
            # rotation noise about the board centre, 2 % range noise
            ti = (c + rng.normal(size=3)*np.array([.01,.01,.02])*z) - rodrigues(ri)@ctr
            f.write(" ".join(repr(float(v)) for v in np.r_[r, t]) + "\n")
            f.write(" ".join(repr(float(v)) for v in np.r_[ri, ti]) + "\n")
            for k in range(N): f.write("%.17g %.17g %.17g\n" % (uv[k,0], uv[k,1], zm[k]))
            n += 1

if __name__ == "__main__":
    out = sys.argv[1]
    os.makedirs(out, exist_ok=True)
    for N in ("44",):
        for C in (30, 300, 3000):
            p = f"{out}/board_{N}_{C}.txt"
            if not os.path.exists(p): main(N, C, p)
