// Yardstick: Mountain Car with Sarsa(lambda = 0.9), replacing traces, 8 tilings of 8x8 tiles (9x9 with offsets) x 3 actions, by hand in C.
// x in [-1.2, 0.5], v in [-0.07, 0.07], v += 0.001a - 0.0025cos 3x, at the left wall v = 0, goal x >= 0.5, reward -1, gamma 1, start
// x ~ U(-0.6, -0.4), v = 0, at most 5000 steps an episode (then it ends without bootstrap error: terminal like the goal, as it is rare).
// epsilon 0, ties evenly at random, alpha 0.5/8, weights 0. Tiling t is offset by t*(1, 3) eighths of a tile, modulo a tile.
// Order: e(s,a) <- 1; d = r + Q(s',a') - Q(s,a), a' chosen before the update; w += alpha d e; e *= gamma lambda. Other actions' traces stay.
//  default  lazy and exact: a weight that is not visited gets alpha*sum_k d_k*D^(k-t0) with D = gamma*lambda: w = A + rho*S where S is the
//           running sum of alpha*d_k*D^k, and A, rho change at visits only. So a step costs 8 rows of a tile read, 8 tiles written, whatever
//           lambda. Every BLOCK steps (float32 has no more digits) and at an episode's end all weights are folded: w = A + rho*S.
//  -DDENSE  all 1,944 weights and traces in each step, SIMD over the weights of a run.
// Worlds and tile numbers: SIMD over W runs. Build: gcc -Ofast -march=native -fopenmp [-DDENSE] limit_mountain_car.c -o limit_mountain_car -lm    Run: ./limit_mountain_car RUNS STEPS
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <stdint.h>
#include <omp.h>
#include <time.h>
#define W 16
#define NT 8
#define NS (NT*81)
#ifndef BLOCK
#define BLOCK 32
#endif
#define CAP 5000
#define FIRST 50
typedef float v4 __attribute__((vector_size(16)));
static float ALPHA=.5f/NT,D=.9f;
static inline uint32_t h(uint32_t x){x^=x>>16;x*=0x7feb352dU;x^=x>>15;x*=0x846ca68bU;x^=x>>16;return x;}
#define U(j) ((h(S->seed[l]+(uint32_t)(s*2+j)*0x9E3779B9u)>>8)*(1.f/16777216.f))
#define SIMD _Pragma("omp simd") for(int l=0;l<W;l++)
typedef struct {float x[W],v[W];int t[W],a[W];uint32_t seed[W];int ep[W];long len[W];} __attribute__((aligned(64))) State;
static inline void tiles(const float*x,const float*v,int id[NT][W]){
  for(int t=0;t<NT;t++){const float ox=t/8.f,ov=t*3%8/8.f,mx=t?8:7,mv=t*3%8?8:7;
    SIMD{float p=(x[l]+1.2f)*(8/1.7f)+ox,q=(v[l]+.07f)*(8/.14f)+ov;p=p>mx?mx:p;q=q>mv?mv:q;id[t][l]=(t*9+(int)p)*9+(int)q;}}
}
static inline int best(v4 q,float u){                 // of the first three, ties evenly at random
  float a=q[0],b=q[1],c=q[2],m=a>b?a:b;m=m>c?m:c;int m0=a==m,m1=b==m,m2=c==m,n=m0+m1+m2,p=(int)(u*n);
  return p<m0?0:(p<m0+m1?1:2);
}
#ifdef DENSE
typedef struct {v4 w[NS],e[NS];} Run;
#else
typedef struct {struct {v4 A,rho;} c[NS];float S,pw;int k;} Run;
static void fold(Run*r,int end){                      // w = A + rho*S; rho is what the trace has decayed to
  v4 S={r->S,r->S,r->S,r->S};float z=end?0:r->pw;v4 Z={z,z,z,z};
  for(int i=0;i<NS;i++){r->c[i].A+=r->c[i].rho*S;r->c[i].rho*=Z;}
  r->S=0;r->pw=1;r->k=0;
}
#endif
static void block(uint32_t base,long n,State*S){
  static __thread Run run[W];int id[NT][W] __attribute__((aligned(64))),nx[NT][W] __attribute__((aligned(64)));float done[W];
  memset(run,0,sizeof run);memset(S,0,sizeof*S);
  float rec[BLOCK+1];rec[0]=1;for(int k=1;k<=BLOCK;k++)rec[k]=rec[k-1]/D;   // D^-k
  long s=-1;for(int l=0;l<W;l++){S->seed[l]=h(base+l);S->x[l]=-.6f+.2f*U(0);S->a[l]=(int)(3*U(1));
#ifndef DENSE
    run[l].pw=1;
#endif
  }
  tiles(S->x,S->v,id);
  for(s=0;s<n;s++){
    float x0[W];int goal[W],cut[W],a2[W];float u[W];
    SIMD{float v=S->v[l]+.001f*(S->a[l]-1)-.0025f*cosf(3*S->x[l]);v=v>.07f?.07f:v;v=v<-.07f?-.07f:v;float x=S->x[l]+v;
      int wall=x<-1.2f;x=wall?-1.2f:x;v=wall?0:v;S->t[l]++;goal[l]=x>=.5f;cut[l]=goal[l]|(S->t[l]>=CAP);
      x0[l]=-.6f+.2f*U(0);u[l]=U(1);S->x[l]=cut[l]?x0[l]:x;S->v[l]=cut[l]?0:v;}
    tiles(S->x,S->v,nx);                              // of the next state, or of the start that follows an end
    for(int l=0;l<W;l++){Run*r=run+l;int a=S->a[l];
#ifdef DENSE
      v4 q={0},q2={0};for(int t=0;t<NT;t++){q+=r->w[id[t][l]];q2+=r->w[nx[t][l]];}
      int b=best(q2,u[l]);float d=-1+(cut[l]?0:q2[b])-q[a],z=ALPHA*d,dd=cut[l]?0:D;
      for(int t=0;t<NT;t++)r->e[id[t][l]][a]=1;
      float*w=(float*)r->w,*e=(float*)r->e;
      #pragma omp simd
      for(int i=0;i<4*NS;i++){w[i]+=z*e[i];e[i]*=dd;}
      if(cut[l]){q2=(v4){0};for(int t=0;t<NT;t++)q2+=r->w[nx[t][l]];b=best(q2,u[l]);}
#else
      v4 SS={r->S,r->S,r->S,r->S},q={0},q2={0};
      #pragma GCC unroll 8
      for(int t=0;t<NT;t++){int i=id[t][l];q+=r->c[i].A+r->c[i].rho*SS;int j=nx[t][l];q2+=r->c[j].A+r->c[j].rho*SS;}
      int b=best(q2,u[l]);float d=-1+(cut[l]?0:q2[b])-q[a],p=rec[r->k];
      #pragma GCC unroll 8
      for(int t=0;t<NT;t++){float*A=(float*)&r->c[id[t][l]].A;A[a]+=(A[4+a]-p)*r->S;A[4+a]=p;}   // w stays as it is, e is 1 from now on
      r->S+=ALPHA*d*r->pw;r->pw*=D;r->k++;
      if(cut[l]|(r->k==BLOCK)){fold(r,cut[l]);
        if(cut[l]){q2=(v4){0};for(int t=0;t<NT;t++)q2+=r->c[nx[t][l]].A;b=best(q2,u[l]);}}
#endif
      a2[l]=b;}
    SIMD{S->len[l]+=S->ep[l]<FIRST?1:0;S->ep[l]+=cut[l];S->t[l]=cut[l]?0:S->t[l];S->a[l]=a2[l];}
    memcpy(id,nx,sizeof id);
  }
}
int main(int c,char**v){long N=atol(v[1]),n=atol(v[2]);if(c>3)ALPHA=atof(v[3])/NT;
  long nb=(N+W-1)/W;State*S=aligned_alloc(64,nb*sizeof(State));struct timespec t0,t1;clock_t u0=clock();
  clock_gettime(CLOCK_MONOTONIC,&t0);
  #pragma omp parallel for schedule(dynamic)
  for(long b=0;b<nb;b++)block(b*W,n,S+b);
  clock_gettime(CLOCK_MONOTONIC,&t1);
  double d=(t1.tv_sec-t0.tv_sec)+1e-9*(t1.tv_nsec-t0.tv_nsec);long ep=0,len=0,all=0;
  for(long r=0;r<N;r++){int m=S[r/W].ep[r%W];if(m>=FIRST)all++;ep+=m<FIRST?m:FIRST;len+=S[r/W].len[r%W];}
  printf("C mountain car %s: runs=%ld %.3f M learning steps/s, by CPU time %.3f (%.1f steps an episode over the first %d, of which %.0f%% of runs have all)\n",
#ifdef DENSE
  "dense",
#else
  "lazy",
#endif
  N,N*(double)n/d/1e6,N*(double)n*omp_get_max_threads()/((clock()-u0)/(double)CLOCKS_PER_SEC)/1e6,len/(double)(ep?ep:1),FIRST,100.*all/N);}
