// Yardstick: tile coding (conf/value/tiles.yaml: 8 grids of 8x8 tiles and offsets, 9*9*8 = 648 weights) on the default experiment
// (conf/config.yaml, conf/env), by hand in C. Peng's Q(lambda), trace=output, 21 candidates, ties evenly at random, epsilon 0.1.
// float32. A slice of W runs goes through all its steps before the next slice starts. No snapshots, no evaluation.
//  default    dense: SIMD over runs, runs last in memory, every weight and trace is touched in each step (one pass for V(s'), one for
//             update + Q of the next state). No gathers: a row is found by masks, as one-hot tensor code has it, in loops.
//  -DSPARSE   a run's weights lie together: SIMD over the candidates for Q (8 loads of a row, 16 shuffles), and over runs for the world;
//             the trace is the tiles of the last H steps, H where (gamma*lambda)^H falls below LEAST (1e-4: 5 for lambda = 0.2).
//             Mind: greedy choices go by the sign of tiny values, so what is dropped at 1e-4 is missed (fewer catches); 1e-12 learns as dense does.
// Build: gcc -Ofast -march=native -fopenmp [-DSPARSE] limit_tiles.c -o limit_tiles -lm      Run: ./limit_tiles RUNS STEPS [ALPHA LAMBDA LEAST]
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <stdint.h>
#include <omp.h>
#include <time.h>
#ifdef __x86_64__
#include <immintrin.h>
#endif
#ifdef __AVX512F__
#define W 16
#else
#define W 8
#endif
#define K 21
#define NT 8
#define NI 9
#define HMAX 64
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
static int J[NT][K];                                  // action tile of each candidate in each tiling
static float OFF[NT],LAST[NT],LEAST=1e-4f;           // LEAST: sparse traces below it are dropped
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
static inline void tiles(const float*b,int it[NT][W]){ // which tile of each tiling a bearing has
  for(int t=0;t<NT;t++)SIMD{float p=(b[l]+1)*4+OFF[t];p=p<0?0:p;p=p>LAST[t]?LAST[t]:p;it[t][l]=(int)p;}
}
static inline void count(State*S,long s,long n){
  SIMD S->al[l]=S->hit[l]>0?S->al[l]*DEC:S->al[l];
  if(s>=n/2)for(int l=0;l<W;l++){S->ep[l]+=S->done[l]>0;S->ca[l]+=S->hit[l]>0;}
}
#ifndef SPARSE
static void block(uint32_t base,float al,float lam,long n,State*S){
  static __thread vf w[NT][NI][NI],e[NT][NI][NI];     // tiling, state tile, action tile
  vf g[NT][NI],g2[NT][NI];int it[NT][W] __attribute__((aligned(64))),it2[NT][W] __attribute__((aligned(64))),ja[NT][W] __attribute__((aligned(64)));
  memset(w,0,sizeof w);memset(e,0,sizeof e);memset(g,0,sizeof g);
  begin(S,base,al);tiles(S->start,it);
  for(long s=0;s<n;s++){
    vf q[K],vmax,v2;int kk[W] __attribute__((aligned(64)));float qa[W] __attribute__((aligned(64)));
    for(int k=0;k<K;k++){vf a=g[0][J[0][k]];for(int t=1;t<NT;t++)a+=g[t][J[t][k]];q[k]=a;}
    vmax=q[0];for(int k=1;k<K;k++)vmax=vmx(q[k],vmax);
    vi nb={0};for(int k=0;k<K;k++)nb-=q[k]==vmax;
    int pk[W] __attribute__((aligned(64)));
    SIMD{float u=U(0);int ex=u<EPS;float sh=ex?u*(1/EPS):(u-EPS)*(1/(1-EPS));int m=((int*)&nb)[l];int p=(int)(sh*(ex?K:m));int top=(ex?K:m)-1;p=p>top?top:p;pk[l]=ex?p-1000:p;}
    vi rank={0},pv=*(vi*)pk,ke={0};for(int k=0;k<K;k++){rank-=q[k]==vmax;ke-=rank<=pv;}
    SIMD{int ex=pk[l]<0;kk[l]=ex?pk[l]+1000:((int*)&ke)[l];S->a[l]=-1.f+.1f*kk[l];}
    for(int t=0;t<NT;t++)SIMD ja[t][l]=J[t][kk[l]];
    SIMD qa[l]=((float*)q)[kk[l]*W+l];
    world(S,s);
    tiles(S->s2,it2);
    for(int t=0;t<NT;t++){                            // pass 1: the row of s' in each tiling, from the weights as they are
      vi i2=*(vi*)it2[t];vf r[NI];for(int j=0;j<NI;j++)r[j]=(vf){0};
      #pragma GCC unroll 9
      for(int i=0;i<NI;i++){vi m=i2==i;
        #pragma GCC unroll 9
        for(int j=0;j<NI;j++)r[j]=(vf)((vi)r[j]|((vi)w[t][i][j]&m));}
      for(int j=0;j<NI;j++)g2[t][j]=r[j];}
    for(int k=0;k<K;k++){vf a=g2[0][J[0][k]];for(int t=1;t<NT;t++)a+=g2[t][J[t][k]];v2=k?vmx(a,v2):a;}
    vf c1,c2,c3,c4;
    SIMD{float rew=S->hit[l]>0?1.f:(S->done[l]>0?-.5f:0.f);float tg=rew+(S->done[l]>0?0:G*v2[l]);float go=1-S->done[l];
      ((float*)&c1)[l]=S->al[l]*(tg-vmax[l])*(G*lam);((float*)&c2)[l]=S->al[l]*(tg-qa[l]);((float*)&c3)[l]=G*lam*go;((float*)&c4)[l]=go*(1.f/NT);}
    int nx[NT][W] __attribute__((aligned(64)));tiles(S->start,nx);
    for(int t=0;t<NT;t++){                            // pass 2: weights, traces, and the row of the next state from the new weights
      vi i1=*(vi*)it[t],in=*(vi*)nx[t],j1=*(vi*)ja[t];vf r[NI];for(int j=0;j<NI;j++)r[j]=(vf){0};
      for(int i=0;i<NI;i++){vi m=i1==i,mn=in==i;
        #pragma GCC unroll 9
        for(int j=0;j<NI;j++){vi on=m&(j1==j);vf ee=e[t][i][j];
          vf ww=w[t][i][j]+c1*ee+(vf)((vi)c2&on);w[t][i][j]=ww;e[t][i][j]=c3*ee+(vf)((vi)c4&on);
          r[j]=(vf)((vi)r[j]|((vi)ww&mn));}}
      for(int j=0;j<NI;j++)g[t][j]=r[j];}
    memcpy(it,nx,sizeof it);
    count(S,s,n);
  }
}
#else
#define NW (NI*NT*NI)
static inline float values(const float*w,int it[NT][W],int l,uint32_t*best,float q[32]){
#ifdef __AVX512F__
  extern __m512i J0[NT],J1[NT];
  __m512 a=_mm512_setzero_ps(),b=a;
  for(int t=0;t<NT;t++){__m512 r=_mm512_loadu_ps(w+(it[t][l]*NT+t)*NI);a+=_mm512_permutexvar_ps(J0[t],r);b+=_mm512_permutexvar_ps(J1[t],r);}
  float m=_mm512_reduce_max_ps(_mm512_max_ps(a,b));   // J1 repeats the last candidate
  if(best){__m512 mm=_mm512_set1_ps(m);*best=_mm512_cmpeq_ps_mask(a,mm)|(uint32_t)(_mm512_cmpeq_ps_mask(b,mm)&31)<<16;_mm512_storeu_ps(q,a);_mm512_storeu_ps(q+16,b);}
  return m;
#else
  float z[24]={0},m=-1e30f;for(int t=0;t<NT;t++){const float*r=w+(it[t][l]*NT+t)*NI;for(int k=0;k<K;k++)z[k]+=r[J[t][k]];}
  for(int k=0;k<K;k++)m=z[k]>m?z[k]:m;
  if(best){uint32_t b=0;for(int k=0;k<K;k++){b|=(uint32_t)(z[k]==m)<<k;q[k]=z[k];}*best=b;}
  return m;
#endif
}
#ifdef __AVX512F__
__m512i J0[NT],J1[NT];
#endif
static inline int nth(uint32_t m,int r){
#ifdef __BMI2__
  return __builtin_ctz(_pdep_u32(1u<<r,m));
#else
  while(r--)m&=m-1;return __builtin_ctz(m);
#endif
}
static void block(uint32_t base,float al,float lam,long n,State*S){
  static __thread float w[W][NW+16];static __thread uint16_t ring[W][HMAX][NT];
  int it[NT][W] __attribute__((aligned(64))),it2[NT][W] __attribute__((aligned(64)));int cnt[W]={0};float d=G*lam,pw[HMAX];
  int H=d<=0?0:(int)(logf(LEAST)/logf(d));H=H>HMAX-1?HMAX-1:H;for(int k=0;k<HMAX;k++)pw[k]=powf(d,k+1)/NT;
  memset(w,0,sizeof w);begin(S,base,al);tiles(S->start,it);
  for(long s=0;s<n;s++){
    int kk[W];float vmax[W],qa[W],sh[W],v2[W],c1[W],c2[W];int ex[W];
    SIMD{float u=U(0);ex[l]=u<EPS;sh[l]=ex[l]?u*(1/EPS):(u-EPS)*(1/(1-EPS));}
    for(int l=0;l<W;l++){uint32_t b;float q[32];vmax[l]=values(w[l],it,l,&b,q);b=ex[l]?(1u<<K)-1:b;int m=__builtin_popcount(b),p=(int)(sh[l]*m);p=p>=m?m-1:p;kk[l]=nth(b,p);qa[l]=q[kk[l]];}
    SIMD S->a[l]=-1.f+.1f*kk[l];
    world(S,s);
    tiles(S->s2,it2);
    for(int l=0;l<W;l++)v2[l]=values(w[l],it2,l,0,0);
    SIMD{float rew=S->hit[l]>0?1.f:(S->done[l]>0?-.5f:0.f);float tg=rew+(S->done[l]>0?0:G*v2[l]);c1[l]=S->al[l]*(tg-vmax[l]);c2[l]=S->al[l]*(tg-qa[l]);}
    for(int l=0;l<W;l++){float*wl=w[l];
      int c=cnt[l],mh=c<H?c:H;
      for(int k=0;k<mh;k++){uint16_t*r=ring[l][(c-1-k)&(HMAX-1)];float z=c1[l]*pw[k];
        #pragma GCC unroll 8
        for(int t=0;t<NT;t++)wl[r[t]]+=z;}
      uint16_t*r=ring[l][c&(HMAX-1)];
      #pragma GCC unroll 8
      for(int t=0;t<NT;t++){int id=(it[t][l]*NT+t)*NI+J[t][kk[l]];r[t]=id;wl[id]+=c2[l];}
      cnt[l]=S->done[l]>0?0:c+1;}
    tiles(S->start,it);
    count(S,s,n);
  }
}
#endif
int main(int c,char**v){long N=atol(v[1]),n=atol(v[2]);float al=c>3?atof(v[3]):.05f,lam=c>4?atof(v[4]):.2f;if(c>5)LEAST=atof(v[5]);
  for(int t=0;t<NT;t++){OFF[t]=t%NT/(float)NT;LAST[t]=ceilf(8+OFF[t])-1;
    for(int k=0;k<K;k++){double o=t*3%NT/(double)NT,p=(double)(float)(.1*k)*4+o;int last=(int)ceil(8+o)-1;J[t][k]=(int)p>last?last:(int)p;}
#if defined(SPARSE)&&defined(__AVX512F__)
    int z[32];for(int k=0;k<32;k++)z[k]=J[t][k<K?k:K-1];J0[t]=_mm512_loadu_si512(z);J1[t]=_mm512_loadu_si512(z+16);
#endif
  }
  long nb=(N+W-1)/W;State*S=aligned_alloc(64,nb*sizeof(State));struct timespec t0,t1;clock_t u0=clock();
  clock_gettime(CLOCK_MONOTONIC,&t0);
  #pragma omp parallel for schedule(dynamic)
  for(long b=0;b<nb;b++)block(b*W,al,lam,n,S+b);
  clock_gettime(CLOCK_MONOTONIC,&t1);
  double d=(t1.tv_sec-t0.tv_sec)+1e-9*(t1.tv_nsec-t0.tv_nsec),ma=0;long ep=0,ca=0;
  for(long r=0;r<N;r++){ma+=S[r/W].al[r%W]/N;ep+=S[r/W].ep[r%W];ca+=S[r/W].ca[r%W];}
  printf("C tiles %s: runs=%ld %.3f M learning steps/s, by CPU time %.3f (mean alpha %.4f, caught in the second half %.3f of %.1f situations a run)\n",
#ifdef SPARSE
  "sparse",
#else
  "dense",
#endif
  N,N*(double)n/d/1e6,N*(double)n*omp_get_max_threads()/((clock()-u0)/(double)CLOCKS_PER_SEC)/1e6,ma,ca/(double)(ep?ep:1),ep/(double)N);}
