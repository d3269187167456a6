"""Yardstick: limit_mountain_car.c the way a user would write it in JAX today: vmap over runs, lax.scan over steps, one jit.

Same world, Sarsa(0.9) with replacing traces, 8 tilings of 9x9 tiles x 3 actions, alpha 0.5/8, ties evenly at random.
Needs: pip install jax jaxlib. Run: python jax_mountain_car.py
"""
import functools, sys, time
import jax, jax.numpy as jnp
D, ALPHA, CAP, FIRST, T = .9, .5 / 8, 5000, 50, jnp.arange(8)
OX, OV = T / 8, T * 3 % 8 / 8

def tiles(x, v):
    p = jnp.minimum((x + 1.2) * (8 / 1.7) + OX, jnp.where(OX > 0, 8, 7)).astype(int)
    q = jnp.minimum((v + .07) * (8 / .14) + OV, jnp.where(OV > 0, 8, 7)).astype(int)
    return (T * 9 + p) * 9 + q

def choose(q, key):
    return jnp.argmax(jnp.where(q == q.max(), jax.random.uniform(key, (3,)), -1.))

def one(st, key):
    x, v, t, a, w, e, ep, ln = st
    k0, k1 = jax.random.split(key)
    at = tiles(x, v)
    v2 = jnp.clip(v + .001 * (a - 1) - .0025 * jnp.cos(3 * x), -.07, .07)
    x2 = x + v2
    v2 = jnp.where(x2 < -1.2, 0., v2); x2 = jnp.maximum(x2, -1.2)
    cut = (x2 >= .5) | (t + 1 >= CAP)
    x2 = jnp.where(cut, jax.random.uniform(k0, minval=-.6, maxval=-.4), x2); v2 = jnp.where(cut, 0., v2)
    to = tiles(x2, v2)
    q2 = w[to].sum(0); a2 = choose(q2, k1)
    d = -1 + jnp.where(cut, 0., q2[a2]) - w[at, a].sum()
    e = e.at[at, a].set(1.)
    w = w + ALPHA * d * e
    e = jnp.where(cut, 0., D) * e
    a2 = jnp.where(cut, choose(w[to].sum(0), k1), a2)
    return (x2, v2, jnp.where(cut, 0, t + 1), a2, w, e, ep + cut, ln + (ep < FIRST)), None

@functools.partial(jax.jit, static_argnums=2, donate_argnums=0)
def runs(st, keys, n):
    def body(st, i):
        return jax.vmap(one)(st, jax.vmap(lambda k: jax.random.fold_in(k, i))(keys))[0], None
    return jax.lax.scan(body, st, jnp.arange(n))[0]

def init(N, seed):
    k = jax.random.split(jax.random.key(seed), 2)
    z = jnp.zeros(N, int)
    return (jax.random.uniform(k[0], (N,), minval=-.6, maxval=-.4), jnp.zeros(N), z, jax.random.randint(k[1], (N,), 0, 3),
            jnp.zeros((N, 648, 3)), jnp.zeros((N, 648, 3)), z + 0, z + 0)

for N, n in ((1104, 1000), (11008, 50)):
    t = time.time(); st = jax.block_until_ready(runs(init(N, 0), jax.random.split(jax.random.key(9), N), n)); c = time.time() - t
    ts = []
    for rep in range(3):
        st, keys = init(N, rep), jax.random.split(jax.random.key(100 + rep), N); jax.block_until_ready((st, keys))
        t = time.time(); jax.block_until_ready(runs(st, keys, n)); ts.append(time.time() - t)
    d = min(ts)
    print(f"JAX mountain car: runs={N} {N*n/d/1e6:.3f} M learning steps/s (first call {c:.1f} s)", flush=True)
