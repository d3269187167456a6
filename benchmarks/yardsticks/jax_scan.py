"""Yardstick: the default experiment (conf/config.yaml, conf/env) the way fast JAX RL code writes it: vmap over runs, lax.scan over steps, one jit.

One learning step = one simulator step plus one Q(lambda) update of one run. Needs: pip install jax jaxlib. Run: python jax_scan.py
"""
import jax, jax.numpy as jnp, math, time, functools
V0,L,dt,R,dc,T,fov=.3,.321,.1,1.5,.2,120,1.0
SC=jnp.array([-0.5,-0.1,0,0.1,0.5]); SS=jnp.array([0.4,0.1,0.05,0.1,0.4])
AC=jnp.array([-1,-0.4,0.4,1.0]); AS=jnp.array([0.4,0.3,0.3,0.4])
A=jnp.linspace(-1,1,21); PA=jnp.exp(-0.5*((A[:,None]-AC)/AS)**2); PA=PA/PA.sum(1,keepdims=True)
gamma,eps,alpha0,decay=.95,.1,.4,.99
def phi(s):
    m=jnp.exp(-0.5*((s-SC)/SS)**2); return m/m.sum()
def wrap(b): return jnp.mod(b+math.pi,2*math.pi)-math.pi
def one(st,lam,key):
    x,y,th,ph,om,t,alpha,w,tr,f=st
    u=jax.random.uniform(key,(6,))
    r=f@w; q=PA@r; vmax=q.max(); k=q.argmax()
    k=jnp.where(u[0]<eps,jnp.minimum((u[1]*21).astype(int),20),k)
    pa=PA[k];a=A[k];qa=(r*pa).sum(); hw=-V0*a/L*dt;v=V0*dt*jnp.sinc(hw/math.pi)
    x2=x+v*jnp.cos(th+hw);y2=y+v*jnp.sin(th+hw);th2=th+2*hw;ph2=ph+om*dt
    dx=R*jnp.cos(ph2)-x2;dy=R*jnp.sin(ph2)-y2
    s2=jnp.clip(wrap(jnp.arctan2(dy,dx)-th2)+.01*jax.scipy.special.ndtri(jnp.clip(u[5],1e-7,1-1e-7)),-fov,fov)
    hit=dx*dx+dy*dy<dc*dc;t2=t+1;done=hit|(t2>=T)
    rew=jnp.where(hit,1.,jnp.where(done,-.5,0.))
    f2=phi(s2);v2=(PA@(f2@w)).max();tgt=rew+gamma*jnp.where(done,0.,v2)
    e=tgt-vmax;e2=tgt-qa
    g=f[:,None]*pa[None];nrm=(g*g).sum()
    tr=tr*gamma*lam; w=w+alpha*e*tr+alpha*e2*g; tr=tr+g/nrm
    alpha=jnp.where(hit,alpha*decay,alpha)
    phr=(u[2]*2-1)*.9;omr=(.05+.1*u[3])*jnp.where(u[4]<.5,-1.,1.)
    z=lambda a_,b_:jnp.where(done,a_,b_)
    s2=z(jnp.clip(phr,-fov,fov),s2)
    return (z(0.,x2),z(0.,y2),z(0.,th2),z(phr,ph2),z(omr,om),z(0,t2),alpha,w,tr*(~done),phi(s2))
@functools.partial(jax.jit,static_argnums=(3,))
def runs(st,lam,keys,n):
    def body(c,i):
        st,=c
        ks=jax.vmap(lambda k:jax.random.fold_in(k,i))(keys)
        return (jax.vmap(one)(st,lam,ks),),None
    (st,),_=jax.lax.scan(body,(st,),jnp.arange(n))
    return st
def init(N):
    z=jnp.zeros(N); ph=(jax.random.uniform(jax.random.key(0),(N,))*2-1)*.9
    return (z,z,z,ph,jnp.full((N,),.1),jnp.zeros(N,int),jnp.full((N,),alpha0),jnp.zeros((N,5,4)),jnp.zeros((N,5,4)),jax.vmap(phi)(ph))
for N,n in ((22,5000),(110,5000),(1100,1000),(11000,100),(50000,30)):
    st=init(N);keys=jax.random.split(jax.random.key(1),N);lam=jnp.full((N,),.2)
    t=time.time();jax.block_until_ready(runs(st,lam,keys,n));c=time.time()-t
    ts=[]
    for _ in range(3):
        t=time.time();jax.block_until_ready(runs(st,lam,keys,n));ts.append(time.time()-t)
    d=min(ts);print(f'jax scan: runs={N} {N*n/d/1e6:.2f} M learning steps/s ({d/n*1e6:.0f} us per step of all runs; first call {c:.1f} s)',flush=True)
