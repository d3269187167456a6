// Yardstick: what two cores can do on the default experiment (conf/config.yaml, conf/env), hand-written in C.
// float32; 16 runs side by side in SIMD; a block of runs goes through all its steps before the next block starts, so its state stays in L1.
// One learning step = one simulator step plus one Q(lambda) update of one run. Evaluation and logging are not in it.
// Build: gcc -Ofast -march=native -fopenmp limit.c -o limit -lm     Run: ./limit RUNS STEPS
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <stdint.h>
#include <omp.h>
#include <time.h>
#define W 16
#define K 21
static const float V0=.3f,L=.321f,dt=.1f,R=1.5f,dc2=.04f,T=120,fov=1.f,G=.95f,EPS=.1f,DEC=.99f;
static const float SC[5]={-.5,-.1,0,.1,.5},SI[5]={1/.4,1/.1,1/.05,1/.1,1/.4};
static const float AC[4]={-1,-.4,.4,1},AI[4]={1/.4,1/.3,1/.3,1/.4};
static float PA[K][4];
static inline uint32_t h(uint32_t x){x^=x>>16;x*=0x7feb352dU;x^=x>>15;x*=0x846ca68bU;x^=x>>16;return x;}
#define U(j) ((h(seed[l]+ (uint32_t)(s*8+j)*0x9E3779B9u)>>8)*(1.f/16777216.f))
static void block(uint32_t base,float lam,long n,float*outw){
  float x[W]={0},y[W]={0},th[W]={0},ph[W],om[W],al[W],w[5][4][W]={0},tr[5][4][W]={0},f[5][W],t[W]={0};uint32_t seed[W];
  for(int l=0;l<W;l++){seed[l]=h(base+l);ph[l]=.3f;om[l]=.1f;al[l]=.4f;}
  for(int l=0;l<W;l++){float sum=0;for(int i=0;i<5;i++){float z=(.3f-SC[i])*SI[i];f[i][l]=expf(-.5f*z*z);sum+=f[i][l];}for(int i=0;i<5;i++)f[i][l]/=sum;}
  for(long s=0;s<n;s++){
    float r[4][W],vmax[W],pa[4][W],a[W],qa[W],s2[W],hit[W],done[W],f2[5][W],v2[W];
    for(int j=0;j<4;j++){
      #pragma omp simd
      for(int l=0;l<W;l++){float q=0;for(int i=0;i<5;i++)q+=w[i][j][l]*f[i][l];r[j][l]=q;}}
    int kk[W];
    for(int l=0;l<W;l++){vmax[l]=-1e30f;kk[l]=0;}
    for(int k=0;k<K;k++){
      #pragma omp simd
      for(int l=0;l<W;l++){float q=PA[k][0]*r[0][l]+PA[k][1]*r[1][l]+PA[k][2]*r[2][l]+PA[k][3]*r[3][l];int b=q>vmax[l];vmax[l]=b?q:vmax[l];kk[l]=b?k:kk[l];}}
    #pragma omp simd
    for(int l=0;l<W;l++){int ke=(int)(U(1)*21);kk[l]=U(0)<EPS?ke:kk[l];a[l]=-1.f+.1f*kk[l];}
    for(int j=0;j<4;j++){
      #pragma omp simd
      for(int l=0;l<W;l++)pa[j][l]=PA[kk[l]][j];}
    #pragma omp simd
    for(int l=0;l<W;l++)qa[l]=pa[0][l]*r[0][l]+pa[1][l]*r[1][l]+pa[2][l]*r[2][l]+pa[3][l]*r[3][l];
    #pragma omp simd
    for(int l=0;l<W;l++){float hw=-V0/L*dt*a[l];float d=V0*dt*(1-hw*hw*(1.f/6)*(1-hw*hw*(1.f/20)));x[l]+=d*cosf(th[l]+hw);y[l]+=d*sinf(th[l]+hw);}
    float dx[W],dy[W];
    #pragma omp simd
    for(int l=0;l<W;l++){th[l]-=2*V0/L*dt*a[l];ph[l]+=om[l]*dt;dx[l]=R*cosf(ph[l])-x[l];dy[l]=R*sinf(ph[l])-y[l];}
    float at[W];
    #pragma omp simd
    for(int l=0;l<W;l++)at[l]=atan2f(dy[l],dx[l]);
    #pragma omp simd
    for(int l=0;l<W;l++){float b=at[l]-th[l];b=b-6.2831853f*rintf(b*(1/6.2831853f));b+=.01f*sqrtf(-2*logf(U(5)+1e-7f))*cosf(6.2831853f*U(6));b=b>fov?fov:b;b=b<-fov?-fov:b;s2[l]=b;
      t[l]+=1;hit[l]=(dx[l]*dx[l]+dy[l]*dy[l]<dc2)?1.f:0.f;done[l]=(hit[l]>0||t[l]>=T)?1.f:0.f;}
    for(int i=0;i<5;i++){
      #pragma omp simd
      for(int l=0;l<W;l++){float z=(s2[l]-SC[i])*SI[i];f2[i][l]=expf(-.5f*z*z);}}
    #pragma omp simd
    for(int l=0;l<W;l++){float q=1/(f2[0][l]+f2[1][l]+f2[2][l]+f2[3][l]+f2[4][l]);for(int i=0;i<5;i++)f2[i][l]*=q;}
    float r2[4][W];
    for(int j=0;j<4;j++){
      #pragma omp simd
      for(int l=0;l<W;l++){float q=0;for(int i=0;i<5;i++)q+=w[i][j][l]*f2[i][l];r2[j][l]=q;}}
    for(int l=0;l<W;l++)v2[l]=-1e30f;
    for(int k=0;k<K;k++){
      #pragma omp simd
      for(int l=0;l<W;l++){float q=PA[k][0]*r2[0][l]+PA[k][1]*r2[1][l]+PA[k][2]*r2[2][l]+PA[k][3]*r2[3][l];v2[l]=q>v2[l]?q:v2[l];}}
    float ae[W],ae2[W],ni[W];
    #pragma omp simd
    for(int l=0;l<W;l++){float rew=hit[l]>0?1.f:(done[l]>0?-.5f:0.f);float tg=rew+(done[l]>0?0:G*v2[l]);ae[l]=al[l]*(tg-vmax[l]);ae2[l]=al[l]*(tg-qa[l]);
      float fs=0,ps=0;for(int i=0;i<5;i++)fs+=f[i][l]*f[i][l];for(int j=0;j<4;j++)ps+=pa[j][l]*pa[j][l];ni[l]=1/(fs*ps);}
    for(int i=0;i<5;i++)for(int j=0;j<4;j++){
      #pragma omp simd
      for(int l=0;l<W;l++){float g=f[i][l]*pa[j][l];float tt=tr[i][j][l]*(G*lam);w[i][j][l]+=ae[l]*tt+ae2[l]*g;tt+=g*ni[l];tr[i][j][l]=done[l]>0?0:tt;}}
    #pragma omp simd
    for(int l=0;l<W;l++){al[l]=hit[l]>0?al[l]*DEC:al[l];
      float phr=(U(2)*2-1)*.9f,omr=(.05f+.1f*U(3))*(U(4)<.5f?-1.f:1.f);int d=done[l]>0;
      x[l]=d?0:x[l];y[l]=d?0:y[l];th[l]=d?0:th[l];ph[l]=d?phr:ph[l];om[l]=d?omr:om[l];t[l]=d?0:t[l];s2[l]=d?phr:s2[l];}
    for(int i=0;i<5;i++){
      #pragma omp simd
      for(int l=0;l<W;l++){float z=(s2[l]-SC[i])*SI[i];f[i][l]=expf(-.5f*z*z);}}
    #pragma omp simd
    for(int l=0;l<W;l++){float q=1/(f[0][l]+f[1][l]+f[2][l]+f[3][l]+f[4][l]);for(int i=0;i<5;i++)f[i][l]*=q;}
  }
  for(int l=0;l<W;l++)outw[l]=w[2][1][l]+w[0][0][l];
}
int main(int c,char**v){long N=atol(v[1]),n=atol(v[2]);
  for(int k=0;k<K;k++){float s=0,a=-1+.1f*k;for(int j=0;j<4;j++){float z=(a-AC[j])*AI[j];PA[k][j]=expf(-.5f*z*z);s+=PA[k][j];}for(int j=0;j<4;j++)PA[k][j]/=s;}
  long nb=(N+W-1)/W;float*o=malloc(nb*W*4);struct timespec t0,t1;
  for(int rep=0;rep<3;rep++){
  clock_gettime(CLOCK_MONOTONIC,&t0);
  #pragma omp parallel for schedule(dynamic)
  for(long b=0;b<nb;b++)block(b*W,.2f,n,o+b*W);
  clock_gettime(CLOCK_MONOTONIC,&t1);
  double d=(t1.tv_sec-t0.tv_sec)+1e-9*(t1.tv_nsec-t0.tv_nsec);
  if(rep==2)printf("C limit: runs=%ld %.1f M learning steps/s (check %.4f)\n",N,N*n/d/1e6,o[3]);}
}
