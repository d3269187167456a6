// Yardstick: a multilayer perceptron (conf/value/mlp.yaml: (bearing, action) -> 32 relu -> Q, 129 weights) on the default experiment
// (conf/config.yaml, conf/env), by hand in C. Peng's Q(lambda), trace=gradient, 21 candidates, epsilon 0.1, ties (there are none to speak of) to the first.
// float32, SIMD over W runs, runs last in memory; gradient by hand. A slice of W runs goes through all its steps before the next one
// starts. Start: U(-1/sqrt(n), 1/sqrt(n)), biases 0. No snapshots, no evaluation.
//  -DLAYERS=2 -DUNITS=64   two layers (4,417 weights); default one layer of 32
// Build: gcc -Ofast -march=native -fopenmp [-DLAYERS=2 -DUNITS=64] limit_mlp.c -o limit_mlp -lm      Run: ./limit_mlp RUNS STEPS [ALPHA LAMBDA]
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <stdint.h>
#include <omp.h>
#include <time.h>
#ifdef __AVX512F__
#include <immintrin.h>
#define W 16
#else
#define W 8
#endif
#ifndef LAYERS
#define LAYERS 1
#endif
#ifndef UNITS
#define UNITS 32
#endif
#define K 21
typedef float vf __attribute__((vector_size(4*W)));
typedef int vi __attribute__((vector_size(4*W)));
static inline vf vmx(vf a,vf b){
#ifdef __AVX512F__
  return (vf)_mm512_max_ps((__m512)a,(__m512)b);
#else
  vi m=a>b;return (vf)(((vi)a&m)|((vi)b&~m));
#endif
}
static const float V0=.3f,L=.321f,dt=.1f,R=1.5f,dc2=.04f,T=120,fov=1.f,G=.95f,EPS=.1f,DEC=.99f;
static inline uint32_t h(uint32_t x){x^=x>>16;x*=0x7feb352dU;x^=x>>15;x*=0x846ca68bU;x^=x>>16;return x;}
#define U(j) ((h(S->seed[l]+ (uint32_t)(s*8+j)*0x9E3779B9u)>>8)*(1.f/16777216.f))
#define SIMD _Pragma("omp simd") for(int l=0;l<W;l++)
typedef struct {float x[W],y[W],th[W],ph[W],om[W],t[W],al[W],a[W],hit[W],done[W],s2[W],start[W];long ep[W],ca[W];uint32_t seed[W];} __attribute__((aligned(64))) State;
static void world(State*S,long s){                    // acts by S->a; s2 is what is seen after it, start what is seen at a restart
  float*x=S->x,*y=S->y,*th=S->th,*ph=S->ph,*om=S->om,*t=S->t,*a=S->a;float dx[W],dy[W],at[W],nz[W];
  SIMD{float hw=-V0/L*dt*a[l];float d=V0*dt*(1-hw*hw*(1.f/6)*(1-hw*hw*(1.f/20)));x[l]+=d*cosf(th[l]+hw);y[l]+=d*sinf(th[l]+hw);}
  SIMD{th[l]-=2*V0/L*dt*a[l];ph[l]+=om[l]*dt;dx[l]=R*cosf(ph[l])-x[l];dy[l]=R*sinf(ph[l])-y[l];}
  SIMD at[l]=atan2f(dy[l],dx[l]);
  SIMD nz[l]=.01f*sqrtf(-2*logf(U(5)+1e-7f))*cosf(6.2831853f*U(6));
  SIMD{float b=at[l]-th[l];b=b-6.2831853f*rintf(b*(1/6.2831853f));b+=nz[l];b=b>fov?fov:b;b=b<-fov?-fov:b;S->s2[l]=b;
    t[l]+=1;S->hit[l]=(dx[l]*dx[l]+dy[l]*dy[l]<dc2)?1.f:0.f;S->done[l]=(S->hit[l]>0||t[l]>=T)?1.f:0.f;}
  SIMD{float phr=(U(2)*2-1)*.9f,omr=(.05f+.1f*U(3))*(U(4)<.5f?-1.f:1.f);int d=S->done[l]>0;
    x[l]=d?0:x[l];y[l]=d?0:y[l];th[l]=d?0:th[l];ph[l]=d?phr:ph[l];om[l]=d?omr:om[l];t[l]=d?0:t[l];S->start[l]=d?phr:S->s2[l];}
}
static void begin(State*S,uint32_t base,float al){
  memset(S,0,sizeof*S);long s=-1;
  for(int l=0;l<W;l++){S->seed[l]=h(base+l);S->ph[l]=(U(2)*2-1)*.9f;S->om[l]=(.05f+.1f*U(3))*(U(4)<.5f?-1.f:1.f);S->al[l]=al;S->start[l]=S->ph[l];}
}
static inline void count(State*S,long s,long n){
  SIMD S->al[l]=S->hit[l]>0?S->al[l]*DEC:S->al[l];
  if(s>=n/2)for(int l=0;l<W;l++){S->ep[l]+=S->done[l]>0;S->ca[l]+=S->hit[l]>0;}
}
typedef struct {vf s[UNITS],a[UNITS],b[UNITS];        // first layer
#if LAYERS==2
  vf w2[UNITS][UNITS],b2[UNITS];
#endif
  vf o[UNITS],c;} Net;                                // output
static const vf ZERO={0};
static void values(const Net*n,vf s,vf q[K]){         // Q(s, .) of all candidates
  vf z[UNITS];for(int u=0;u<UNITS;u++)z[u]=n->s[u]*s+n->b[u];
#if LAYERS==1
  vf acc[K];
  for(int k=0;k<K;k++)acc[k]=n->c;
  for(int u=0;u<UNITS;u++){vf wa=n->a[u],o=n->o[u],zu=z[u];
    #pragma GCC unroll 21
    for(int k=0;k<K;k++)acc[k]+=o*vmx(zu+wa*(-1.f+.1f*k),ZERO);}
  for(int k=0;k<K;k++)q[k]=acc[k];
#else
  #define KB 7                                        // candidates and units of a block: 14 sums stay in registers
  for(int k0=0;k0<K;k0+=KB){vf h1[UNITS][KB];
    for(int v=0;v<UNITS;v++)
      #pragma GCC unroll 7
      for(int k=0;k<KB;k++)h1[v][k]=vmx(z[v]+n->a[v]*(-1.f+.1f*(k0+k)),ZERO);
    vf out[KB];for(int k=0;k<KB;k++)out[k]=n->c;
    for(int u=0;u<UNITS;u+=2){vf A[KB],B[KB];
      #pragma GCC unroll 7
      for(int k=0;k<KB;k++){A[k]=n->b2[u];B[k]=n->b2[u+1];}
      for(int v=0;v<UNITS;v++){vf x=n->w2[u][v],y=n->w2[u+1][v];
        #pragma GCC unroll 7
        for(int k=0;k<KB;k++){A[k]+=x*h1[v][k];B[k]+=y*h1[v][k];}}
      #pragma GCC unroll 7
      for(int k=0;k<KB;k++)out[k]+=n->o[u]*vmx(A[k],ZERO)+n->o[u+1]*vmx(B[k],ZERO);}
    for(int k=0;k<KB;k++)q[k0+k]=out[k];}
#endif
}
#define STEP(w,e,f) do{vf f_=(f),e_=(e)*c1;(w)+=c2*(e)+c3*f_;(e)=e_+c4*f_;}while(0)
static void block(uint32_t base,float al,float lam,long n,State*S){
  static __thread Net w,e;
  memset(&e,0,sizeof e);memset(&w,0,sizeof w);begin(S,base,al);
  long s=-2;uint32_t d=0;
  #define R0(x,n) SIMD{((float*)&(x))[l]=((h(S->seed[l]^h(d+77))>>8)*(2.f/16777216.f)-1)/sqrtf(n);}d++;
  for(int u=0;u<UNITS;u++){R0(w.s[u],2)R0(w.a[u],2)R0(w.o[u],UNITS)
#if LAYERS==2
    for(int v=0;v<UNITS;v++){R0(w.w2[u][v],UNITS)}
#endif
  }
  (void)s;
  for(long s=0;s<n;s++){
    vf q[K],vmax,v2,st=*(vf*)S->start;int kk[W] __attribute__((aligned(64)));float qa[W] __attribute__((aligned(64)));
    values(&w,st,q);
    vmax=q[0];for(int k=1;k<K;k++)vmax=vmx(q[k],vmax);
    vi kg={0};for(int k=K-1;k>=0;k--){vi m=q[k]==vmax;kg=(m&k)|(~m&kg);}
    SIMD{int ke=(int)(U(1)*K);kk[l]=U(0)<EPS?ke:((int*)&kg)[l];S->a[l]=-1.f+.1f*kk[l];}
    SIMD qa[l]=((float*)q)[kk[l]*W+l];
    vf a=*(vf*)S->a;
    world(S,s);
    vf s2=*(vf*)S->s2;values(&w,s2,q);
    v2=q[0];for(int k=1;k<K;k++)v2=vmx(q[k],v2);
    vf c1,c2,c3,c4;
    SIMD{float rew=S->hit[l]>0?1.f:(S->done[l]>0?-.5f:0.f);float tg=rew+(S->done[l]>0?0:G*v2[l]);float go=1-S->done[l];
      ((float*)&c2)[l]=S->al[l]*(tg-vmax[l])*(G*lam);((float*)&c3)[l]=S->al[l]*(tg-qa[l]);((float*)&c1)[l]=G*lam*go;((float*)&c4)[l]=go;}
#if LAYERS==1
    for(int u=0;u<UNITS;u++){vf z=w.s[u]*st+w.b[u]+w.a[u]*a;vf dz=(vf)((vi)w.o[u]&(z>0));
      STEP(w.s[u],e.s[u],dz*st);STEP(w.a[u],e.a[u],dz*a);STEP(w.b[u],e.b[u],dz);STEP(w.o[u],e.o[u],vmx(z,ZERO));}
#else
    vf h1[UNITS],d1[UNITS];
    for(int v=0;v<UNITS;v++){h1[v]=vmx(w.s[v]*st+w.b[v]+w.a[v]*a,ZERO);d1[v]=ZERO;}
    for(int u=0;u<UNITS;u++){vf z0=w.b2[u],z1=ZERO,z2=ZERO,z3=ZERO;
      for(int v=0;v<UNITS;v+=4){z0+=w.w2[u][v]*h1[v];z1+=w.w2[u][v+1]*h1[v+1];z2+=w.w2[u][v+2]*h1[v+2];z3+=w.w2[u][v+3]*h1[v+3];}
      vf z=(z0+z1)+(z2+z3);vf dz=(vf)((vi)w.o[u]&(z>0));
      for(int v=0;v<UNITS;v++){d1[v]+=w.w2[u][v]*dz;STEP(w.w2[u][v],e.w2[u][v],dz*h1[v]);}
      STEP(w.b2[u],e.b2[u],dz);STEP(w.o[u],e.o[u],vmx(z,ZERO));}
    for(int v=0;v<UNITS;v++){vf dz=(vf)((vi)d1[v]&(h1[v]>0));STEP(w.s[v],e.s[v],dz*st);STEP(w.a[v],e.a[v],dz*a);STEP(w.b[v],e.b[v],dz);}
#endif
    STEP(w.c,e.c,ZERO+1.f);
    count(S,s,n);
  }
}
int main(int c,char**v){long N=atol(v[1]),n=atol(v[2]);float al=c>3?atof(v[3]):(LAYERS==1?.05f:.01f),lam=c>4?atof(v[4]):.2f;
  long nb=(N+W-1)/W;State*S=aligned_alloc(64,nb*sizeof(State));struct timespec t0,t1;clock_t u0=clock();
  clock_gettime(CLOCK_MONOTONIC,&t0);
  #pragma omp parallel for schedule(dynamic)
  for(long b=0;b<nb;b++)block(b*W,al,lam,n,S+b);
  clock_gettime(CLOCK_MONOTONIC,&t1);
  double d=(t1.tv_sec-t0.tv_sec)+1e-9*(t1.tv_nsec-t0.tv_nsec),ma=0;long ep=0,ca=0;
  for(long r=0;r<N;r++){ma+=S[r/W].al[r%W]/N;ep+=S[r/W].ep[r%W];ca+=S[r/W].ca[r%W];}
  printf("C mlp %dx%d: runs=%ld %.3f M learning steps/s, by CPU time %.3f (mean alpha %.4f of %.4f, caught in the second half %.3f of %.1f situations a run)\n",LAYERS,UNITS,
  N,N*(double)n/d/1e6,N*(double)n*omp_get_max_threads()/((clock()-u0)/(double)CLOCKS_PER_SEC)/1e6,ma,al,ca/(double)(ep?ep:1),ep/(double)N);}
